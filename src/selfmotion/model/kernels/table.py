"""Table of a rollout: one row per stage, and the parts of a row.

A call from Python costs as much per array argument as a good part of the arithmetic, hence one
table in place of a dozen arrays.
"""

from math import prod
from typing import Any, NamedTuple

from numba import types
from numba.extending import lower_builtin, type_callable

from selfmotion.basics import Array, inlined


def view(row: Array, first: int, shape: tuple[int, ...]) -> Array:
    """Return a view of a part of a row (or of each row of a table), as an array of `shape`.

    An array of that shape is one of itself.

    Compiled, it is an address and a shape. A slice with `reshape` would be the same at a multiple
    of the price of a stage's arithmetic: it checks, copies if it must, and counts references.
    """
    if row.shape == shape:
        return row
    return row[..., first : first + prod(shape)].reshape(row.shape[:-1] + shape)


@type_callable(view)
def _type_view(context: Any) -> Any:
    def typer(row: Any, first: Any, shape: Any) -> Any:
        return types.Array(types.float64, len(shape), "C")

    return typer


@lower_builtin(view, types.Array, types.Integer, types.BaseTuple)
def _lower_view(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    # Only compiling needs these, and they take as long to import as a tenth of the package.
    from numba.core import cgutils
    from numba.np.arrayobj import make_array, populate_array

    row = make_array(signature.args[0])(context, builder, arguments[0])
    found = make_array(signature.return_type)(context, builder)
    shape = cgutils.unpack_tuple(builder, arguments[2])
    strides = [context.get_constant(types.intp, 8)]
    for size in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], size))
    populate_array(
        found,
        data=builder.gep(row.data, [arguments[1]]),
        shape=shape,
        strides=strides,
        itemsize=strides[-1],
        meminfo=None,
    )
    return found._getvalue()


class Stage(NamedTuple):
    """The parts of a stage's row, as views of it; or of the whole table's, one index more.

    Attributes
    ----------
    q, qd, epsilon : (n,)
        q, q̇ and ε.
    step : (1,)
        The length [s] of the Runge-Kutta step.
    task_jacobian : (m, n)
        J: the rows S J6 of all tips.
    factor, y : (m, m), (m,)
        The Cholesky factor of A, and y.
    damping : (3 + m,)
        λ0², f, df/dσ² and v, see `damp`; 0 where nothing is damped.
    """

    q: Array
    qd: Array
    epsilon: Array
    step: Array
    task_jacobian: Array
    factor: Array
    y: Array
    damping: Array


class Tip(NamedTuple):
    """The parts of a stage's row that belong to one tip, as views of it.

    Attributes
    ----------
    target_translation, target_rotation, target_twist : (3,), (3, 3), (6,)
        Pose and twist ẋ_d of its path.
    translation, rotation : (3,), (3, 3)
        The tip's pose.
    error : (6,)
        Its pose error e.
    command : (6,)
        ẋ_d + K e.
    jacobian : (6, n)
        J6.
    """

    target_translation: Array
    target_rotation: Array
    target_twist: Array
    translation: Array
    rotation: Array
    error: Array
    command: Array
    jacobian: Array


@inlined
def stage_of(table: Array, n: int, m: int) -> Stage:
    """Return the parts of a row or of a table, for n joints and m rows of all tips."""
    linear = 3 * n + 1
    solution = linear + m * n
    return Stage(
        q=view(table, 0, (n,)),
        qd=view(table, n, (n,)),
        epsilon=view(table, 2 * n, (n,)),
        step=view(table, 3 * n, (1,)),
        task_jacobian=view(table, linear, (m, n)),
        factor=view(table, solution, (m, m)),
        y=view(table, solution + m * m, (m,)),
        damping=view(table, solution + m * m + m, (3 + m,)),
    )


@inlined
def tip_of(table: Array, f: int, n: int, m: int) -> Tip:
    """Return the parts of a row or of a table that belong to tip f; see `stage_of`."""
    first = shared_columns(n, m) + f * tip_columns(n)
    return Tip(
        target_translation=view(table, first, (3,)),
        target_rotation=view(table, first + 3, (3, 3)),
        target_twist=view(table, first + 12, (6,)),
        translation=view(table, first + 18, (3,)),
        rotation=view(table, first + 21, (3, 3)),
        error=view(table, first + 30, (6,)),
        command=view(table, first + 36, (6,)),
        jacobian=view(table, first + 42, (6, n)),
    )


def path_of(table: Array, f: int, n: int, m: int) -> Array:
    """Return a tip's path as `tip_of` has it, in one: target translation, rotation and twist."""
    return view(table, shared_columns(n, m) + f * tip_columns(n), (18,))


def rates_of(table: Array, n: int) -> tuple[Array, Array]:
    """Return q̇ and ε of a whole table, as `stage_of` has them: of all parts, two."""
    return table[:, n : 2 * n], table[:, 2 * n : 3 * n]


@inlined
def q_of(table: Array, s: int, n: int) -> Array:
    """Return q of stage s, as `stage_of` has it."""
    return view(table[s], 0, (n,))


@inlined
def qd_of(table: Array, s: int, n: int) -> Array:
    """Return q̇ of stage s, as `stage_of` has it."""
    return view(table[s], n, (n,))


@inlined
def shared_columns(n: int, m: int) -> int:
    """Return the length of a row's common part."""
    return 3 * n + 4 + m * n + m * m + 2 * m


@inlined
def tip_columns(n: int) -> int:
    """Return the length of a row's part for each tip."""
    return 42 + 6 * n


def columns(n: int, m: int, tips: int) -> int:
    """Return the length of a row."""
    return int(shared_columns(n, m) + tips * tip_columns(n))
