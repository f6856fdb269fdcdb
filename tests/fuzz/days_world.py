"""The files of a world of springs from the nominal robot, of days with costs, and of programs."""

from tests.fuzz.arm_worlds import ROBOT as ARM

MASSES = """mass_kg = 40
center_m = [0.1, 0, 0.05]
"""
WRIST = """
[[joints]]
name = "q4"
origin_m = [0.5, 0, 0]
axis = [1, 0, 0]
limits_deg = [-180, 180]
mass_kg = 10
center_m = [0.1, 0, 0]

[[joints]]
name = "q5"
origin_m = [0.3, 0, 0]
axis = [0, 1, 0]
limits_deg = [-120, 120]
mass_kg = 5
center_m = [0.05, 0, 0]

[[joints]]
name = "q6"
origin_m = [0.1, 0, 0]
axis = [1, 0, 0]
limits_deg = [-180, 180]
mass_kg = 3
center_m = [0.05, 0, 0]
"""
ROBOT = ARM.replace("]\n\n[[", f"]\n{MASSES}\n[[") + MASSES + WRIST

STUDY = """
title = "Days"
robot = "robot.toml"
seed = 3
sizes = [2]
candidates = 40
starts = 1
optimise = ["D"]
criteria = ["D", "rho0"]

[tool]
position_mm = [200, 0, -100]

[load]
F_N = [0, 0, -500]

[measurement]
sigma_mm = 0.05
reference = "nominal"

[joints]
unknown = ["q2", "q3", "q5"]
fixed_deg = { q1 = 0 }

[costs]
visit = 2
loaded_visit = 3
load_change = 5
budget = 12
unit = "min"

[frames.tool]
1 = { position_mm = [300, 0, 0] }

[frames.base]
default = { position_mm = [0, 0, 0] }

[test_pose]
q_deg = [0, -40, 80, 10, 40, 0]
tool = { position_mm = [300, 0, 0] }
load = { F_N = [0, 100, -200] }

[simulation]
compliance_rad_per_Nm = { q2 = 3e-7, q3 = 4e-7, q5 = 2.8e-6 }
"""

PLAN = """q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,repeats
0,-40,80,10,40,0,1
0,-60,100,-30,60,90,2
0,20,-40,50,-70,-30,1
"""
TASK = """q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,Fz_N
0,-40,80,10,40,0,-200
15,-45,60,10,30,20,-100
"""
EXCLUDE = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n0,-100,-100,0,0,0\n"

PROGRAMS = {
    "drill.src": """DEF drill ( )
DECL E6AXIS home
home = {A1 5, A2 -40, A3 90, A4 10, A5 50, A6 0, E1 0}
$TOOL = TOOL_DATA[1]
PTP {A1 0, A2 -40, A3 80, A4 10, A5 40, A6 0} C_PTP ; first
IF $IN[1] == TRUE THEN
  PTP home
ENDIF
LIN {X 1300.0, Y 100.0, Z 800.0, A 0.0, B 60.0, C 0.0}
END
""",
    "drill.mod": """MODULE drill
CONST jointtarget home := [[0,-40,80,10,40,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
PERS tooldata t1 := [TRUE,[[300,0,0],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
CONST robtarget a := [[1300,100,800],[0.866,0,0.5,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
PROC main()
  MoveAbsJ home,v100,fine,t1;
  IF di1 = 1 THEN
    MoveL Offs(a,0,0,10),v100,fine,t1;
  ENDIF
  MoveL a,v100,fine,t1; ! here
ENDPROC
ENDMODULE
""",
    "drill.script": """def drill():
  set_tcp(p[0.3,0,0,0,0,0])
  home = [0, -0.7, 1.4, 0.2, 0.7, 0]
  movej(home, a=1.4, v=1.05)
  if get_digital_in(1):
    movel(p[1.3,0.1,0.8,0,1.05,0])
  end
  movel(p[1.3,0.1,0.9,0,1.05,0]) # here
end
""",
    "drill.ls": """/PROG DRILL
/ATTR
/MN
   1:  UTOOL_NUM=1 ;
   2:J P[1] 20% FINE ;
   3:  IF DI[1]=ON,JMP LBL[1] ;
   4:L P[2] 100mm/sec FINE ;
   5:  LBL[1] ;
/POS
P[1]{
   GP1:
  UF : 0, UT : 1,
  J1= 0.000 deg, J2= -40.000 deg, J3= 80.000 deg,
  J4= 10.000 deg, J5= 40.000 deg, J6= 0.000 deg
};
P[2]{
   GP1:
  UF : 0, UT : 1, CONFIG : 'N U T, 0, 0, 0',
  X = 1300.000 mm, Y = 100.000 mm, Z = 800.000 mm,
  W = 0.000 deg, P = 60.000 deg, R = 0.000 deg
};
/END
""",
}
