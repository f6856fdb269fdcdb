"""The keys of the smallest study of the KR 270, and of the task of its paper."""

REQUIRED = {
    "robot": "kuka_kr270",
    "tool": {"position_mm": [611.5, 0, -460]},
    "load": {"F_N": [0, 0, -2500]},
    "measurement": {"sigma_mm": 0.03},
    "joints": {"unknown": ["q2", "q3", "q4", "q5", "q6"], "fixed_deg": {"q1": 0}},
}
TEST_POSE = {
    "q_deg": [0, -56.9, 89.3, 45.1, 76, 57.2],
    "tool": {"position_mm": [986, 0, 0]},
    "load": {"F_N": [0, 280, -180]},
}
