"""The table that a rollout works on: one row per stage, and what the parts of a row are.

A call from Python costs as much per array argument as a good part of the arithmetic, hence one
table in place of a dozen arrays.
"""

from math import prod
from typing import Any, NamedTuple

from numba import types
from numba.extending import lower_builtin, type_callable

from selfmotion.basics import Array, inlined


def part(row: Array, first: int, shape: tuple[int, ...]) -> Array:
    """Return a view of a part of a row (or of each row of a table), as an array of `shape`.

    Compiled, it is an address and a shape. A slice with `reshape` would be the same at a multiple
    of the price of a stage's arithmetic: it checks, copies if it must, and counts references.
    """
    return row[..., first : first + prod(shape)].reshape(row.shape[:-1] + shape)


@type_callable(part)
def _type_part(context: Any) -> Any:
    def typer(row: Any, first: Any, shape: Any) -> Any:
        return types.Array(types.float64, len(shape), "C")

    return typer


@lower_builtin(part, types.Array, types.Integer, types.BaseTuple)
def _lower_part(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    # Only compiling needs these, and they take as long to import as a tenth of the package.
    from numba.core import cgutils
    from numba.np.arrayobj import make_array, populate_array

    row = make_array(signature.args[0])(context, builder, arguments[0])
    view = make_array(signature.return_type)(context, builder)
    shape = cgutils.unpack_tuple(builder, arguments[2])
    strides = [context.get_constant(types.intp, 8)]
    for size in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], size))
    populate_array(
        view,
        data=builder.gep(row.data, [arguments[1]]),
        shape=shape,
        strides=strides,
        itemsize=strides[-1],
        meminfo=None,
    )
    return view._getvalue()


class Stage(NamedTuple):
    """The parts of a stage's row, as views of it; or of the whole table's, one index more.

    Attributes
    ----------
    q, qd, epsilon : (n,)
        q, q̇ and ε.
    target_translation, target_rotation, target_twist : (3,), (3, 3), (6,)
        Pose and twist ẋ_d of the path.
    step : (1,)
        The length [s] of the Runge-Kutta step.
    translation, rotation : (3,), (3, 3)
        The tool's pose.
    error : (6,)
        Its pose error e.
    command : (6,)
        ẋ_d + K e.
    jacobian, task_jacobian : (6, n), (m, n)
        J6 and J = S J6.
    factor, y : (m, m), (m,)
        The Cholesky factor of A, and y.
    damping : (3 + m,)
        λ0², f, df/dσ² and v, see `damp`; 0 where nothing is damped.
    """

    q: Array
    qd: Array
    epsilon: Array
    target_translation: Array
    target_rotation: Array
    target_twist: Array
    step: Array
    translation: Array
    rotation: Array
    error: Array
    command: Array
    jacobian: Array
    task_jacobian: Array
    factor: Array
    y: Array
    damping: Array


@inlined
def parts(table: Array, n: int, m: int) -> Stage:
    """Return the parts of a row or of a table, for n joints and m rows of the task."""
    path = 3 * n
    tool = path + 19
    linear = tool + 24
    solution = linear + (6 + m) * n
    return Stage(
        q=part(table, 0, (n,)),
        qd=part(table, n, (n,)),
        epsilon=part(table, 2 * n, (n,)),
        target_translation=part(table, path, (3,)),
        target_rotation=part(table, path + 3, (3, 3)),
        target_twist=part(table, path + 12, (6,)),
        step=part(table, path + 18, (1,)),
        translation=part(table, tool, (3,)),
        rotation=part(table, tool + 3, (3, 3)),
        error=part(table, tool + 12, (6,)),
        command=part(table, tool + 18, (6,)),
        jacobian=part(table, linear, (6, n)),
        task_jacobian=part(table, linear + 6 * n, (m, n)),
        factor=part(table, solution, (m, m)),
        y=part(table, solution + m * m, (m,)),
        damping=part(table, solution + m * m + m, (3 + m,)),
    )


@inlined
def q_of(table: Array, s: int, n: int) -> Array:
    """Return q of stage s, as `parts` has it."""
    return part(table[s], 0, (n,))


@inlined
def qd_of(table: Array, s: int, n: int) -> Array:
    """Return q̇ of stage s, as `parts` has it."""
    return part(table[s], n, (n,))


def columns(n: int, m: int) -> int:
    """Return the length of a row."""
    return 9 * n + 43 + m * n + m * m + 2 * m + 3
