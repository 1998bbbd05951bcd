"""What `import selfmotion` offers, by name and module; each is imported when it is first used."""

from selfmotion import (
    baselines as baselines,
    certificate as certificate,
    constraints as constraints,
    costs as costs,
    errors as errors,
    files as files,
    job as job,
    margins as margins,
    motion as motion,
    obstacles as obstacles,
    optimise as optimise,
    paths as paths,
    placement as placement,
    realtime as realtime,
    replay as replay,
    result as result,
    robot as robot,
    testing as testing,
)
from selfmotion.basics import (
    SelfmotionError as SelfmotionError,
)
from selfmotion.certificate import (
    Certificate as Certificate,
    Tolerance as Tolerance,
    certify as certify,
)
from selfmotion.model.follow import (
    Follow as Follow,
    Follows as Follows,
)
from selfmotion.model.motion import (
    PolynomialNullMotion as PolynomialNullMotion,
    Trajectory as Trajectory,
)
from selfmotion.model.robot import (
    NAMED_ARMS as NAMED_ARMS,
    RobotModel as RobotModel,
    load_robot as load_robot,
)
from selfmotion.model.task import (
    Damping as Damping,
    Relaxation as Relaxation,
    Task as Task,
)
from selfmotion.paper.baselines import (
    plan_by as plan_by,
)
from selfmotion.planning.optimise import (
    QuasiNewton as QuasiNewton,
)
from selfmotion.planning.planner import (
    Fastest as Fastest,
    Search as Search,
    fastest as fastest,
    plan as plan,
    plan_in_parts as plan_in_parts,
)
from selfmotion.planning.result import (
    Move as Move,
    Parts as Parts,
    Plan as Plan,
    Report as Report,
    compare as compare,
    load_plan as load_plan,
    retime as retime,
    slowdown as slowdown,
)
from selfmotion.planning.transfer import (
    move as move,
)
from selfmotion.problem.problem import (
    Problem as Problem,
    calibrated as calibrated,
    off_nominal as off_nominal,
    sample_problem as sample_problem,
)
from selfmotion.realtime import (
    Replanner as Replanner,
    warm_up as warm_up,
)
from selfmotion.shell.documents import (
    read_problem as read_problem,
)
from selfmotion.work.batch import (
    Batch as Batch,
    plan_many as plan_many,
)
from selfmotion.work.job import (
    Program as Program,
    Seam as Seam,
    load_program as load_program,
    plan_job as plan_job,
)
from selfmotion.work.margins import (
    Margin as Margin,
    margin as margin,
)
from selfmotion.work.placement import (
    correction as correction,
    place as place,
    plan_with_margin as plan_with_margin,
)

__version__: str
