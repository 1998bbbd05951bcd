"""A weld seam from a table, with a torch: turn about its axis and start configuration are free."""

from pathlib import Path

import selfmotion as sm

HERE = Path(__file__).parent
OUT = Path("out")

# The torch ends 50 mm before the gripper's tool frame.
torch = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.05], [0, 0, 0, 1]]
panda = sm.load_robot("panda", tool_offset=torch)

# The seam is drawn on the workpiece; the workpiece stands here. Run up to 40 mm/s and down again.
workpiece = [[1, 0, 0, 0.45], [0, 1, 0, -0.1], [0, 0, 1, 0.35], [0, 0, 0, 1]]
seam = sm.files.read_path(HERE / "seam.csv", feed=0.04)
path = sm.paths.section_at_rest(sm.paths.Placed(seam, workpiece), ramp=0.5)

problem = sm.Problem(
    panda,
    path,
    task="pointing",
    costs=[sm.costs.JointVelocity(), sm.costs.InverseManipulability(mu=0.01)],
)
plan = sm.plan(problem, search=sm.Search(starts=12, finalists=2)).require()
print(f"{path.duration:.2f} s, cost {plan.report.initial_cost:.4f} → {plan.report.cost:.4f}")
print(plan.certificate.verdict)
margin = plan.certificate.limit_margin
print(f"nearest to a joint limit: {margin.name}, {margin.value:.2f} rad at {margin.time:.2f} s")
plan.save(OUT / "seam.npz")
sm.files.write_motion(plan, OUT / "seam.csv", rate=250)
