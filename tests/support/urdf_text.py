"""A URDF with everything in it: fixed and turned frames, all kinds of joints, masses, branches."""

from pathlib import Path

# world -fixed-> base -turn-> arm -bend-> elbow -slide-> hand -fixed-> flange; camera and finger
# hang on the hand, a marker on the base.
ARM = """<?xml version="1.0"?>
<robot name="arm">
  <link name="world"/>
  <link name="base"><inertial><mass value="100"/></inertial></link>
  <link name="mark"/>
  <link name="arm">
    <inertial><origin xyz="0.5 0 0" rpy="1 2 3"/><mass value="20"/></inertial>
    <visual><geometry><mesh filename="package://nowhere/arm.dae"/></geometry></visual>
  </link>
  <link name="elbow"/>
  <link name="hand"><inertial><origin xyz="0 0 0.1"/><mass value="2"/></inertial></link>
  <link name="camera"><inertial><mass value="1"/></inertial></link>
  <link name="finger"><inertial><mass value="0.5"/></inertial></link>
  <link name="flange"><inertial><mass value="0.5"/></inertial></link>
  <joint name="stand" type="fixed">
    <origin xyz="0 0 0.5" rpy="0 0 1.5707963267948966"/><parent link="world"/><child link="base"/>
  </joint>
  <joint name="note" type="fixed"><parent link="base"/><child link="mark"/></joint>
  <joint name="turn" type="continuous">
    <origin xyz="0 0 0.2"/><parent link="base"/><child link="arm"/><axis xyz="0 0 2"/>
  </joint>
  <joint name="bend" type="revolute">
    <origin xyz="1 0 0" rpy="0.1 -0.2 0.3"/><parent link="arm"/><child link="elbow"/>
    <limit lower="-1" upper="2" effort="1" velocity="1"/>
  </joint>
  <joint name="slide" type="prismatic">
    <origin xyz="0 0.1 0"/><parent link="elbow"/><child link="hand"/><axis xyz="0 0 -1"/>
    <limit lower="0.1" upper="0.4"/>
  </joint>
  <joint name="eye" type="fixed">
    <origin xyz="0 0.1 0" rpy="0 1 0"/><parent link="hand"/><child link="camera"/>
  </joint>
  <joint name="grip" type="prismatic">
    <parent link="hand"/><child link="finger"/><limit lower="0.02" upper="0.05"/>
  </joint>
  <joint name="plate" type="fixed">
    <origin xyz="0 0 0.3" rpy="0 0.5 0"/><parent link="hand"/><child link="flange"/>
  </joint>
  <transmission name="t"><joint name="turn"/></transmission>
  <gazebo:plugin><deep><deeper/></deep></gazebo:plugin>
</robot>
"""


def written(folder: Path, *changes: tuple[str, str]) -> Path:
    """The file in a folder, with some texts in place of others."""
    text = ARM
    for old, new in changes:
        assert text.count(old) >= 1, old
        text = text.replace(old, new, 1)
    path = folder / "arm.urdf"
    path.write_text(text)
    return path
