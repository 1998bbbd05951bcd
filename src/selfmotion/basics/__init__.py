"""What knows nothing of robots; all others import it from here.

=========== ======================================================================================
`arrays`    types of arrays, and arguments that are checked and made numbers (``as_…``)
`errors`    all errors, one tree
`files`     files, read and written whole or not at all; digests
`intervals` places among increasing numbers, compiled
`jit`       numerical kernels, compiled by numba once per machine
`progress`  reports while something runs, and interruption
`saved`     classes that describe themselves in files, and are restored by their kind
`series`    majorants: bounds of all derivatives of a function on intervals of time
`tables`    documents (TOML, JSON, YAML) and tables, in SI units
`units`     lengths and angles in words
=========== ======================================================================================
"""

from selfmotion.basics import series as series
from selfmotion.basics.arrays import (
    Array as Array,
    Flags as Flags,
    Ints as Ints,
    per_joint as per_joint,
    plain as plain,
    plain_numbers as plain_numbers,
    read_only as read_only,
    shown as shown,
)
from selfmotion.basics.errors import (
    BreakdownError as BreakdownError,
    CollisionError as CollisionError,
    DeadlineError as DeadlineError,
    FeedError as FeedError,
    FileFormatError as FileFormatError,
    FormerUseWarning as FormerUseWarning,
    InverseKinematicsError as InverseKinematicsError,
    NoSequenceError as NoSequenceError,
    PathError as PathError,
    PlanError as PlanError,
    ProblemError as ProblemError,
    RedundancyError as RedundancyError,
    RenderError as RenderError,
    RobotError as RobotError,
    SelfmotionError as SelfmotionError,
    StartError as StartError,
    nearest as nearest,
)
from selfmotion.basics.files import (
    ARCHIVE_SUFFIXES as ARCHIVE_SUFFIXES,
    DOCUMENT_SUFFIXES as DOCUMENT_SUFFIXES,
    as_path as as_path,
    digest_of as digest_of,
    digest_of_file as digest_of_file,
    is_file as is_file,
    is_folder as is_folder,
    lines_of as lines_of,
    read_archive as read_archive,
    read_arrays as read_arrays,
    text_of as text_of,
    version as version,
    write_archive as write_archive,
    write_atomically as write_atomically,
    write_bytes as write_bytes,
    write_csv as write_csv,
    write_text as write_text,
)
from selfmotion.basics.inputs import (
    TURN as TURN,
    as_called as as_called,
    as_choice as as_choice,
    as_flag as as_flag,
    as_number as as_number,
    as_numbers as as_numbers,
    as_several as as_several,
    as_whole as as_whole,
    check_executor as check_executor,
    is_number as is_number,
    number_in as number_in,
    public_name as public_name,
    random_numbers as random_numbers,
)
from selfmotion.basics.interruption import (
    Counts as Counts,
    held_interruption as held_interruption,
    obey_interruption as obey_interruption,
    obeying as obeying,
    presses as presses,
    was_interrupted as was_interrupted,
)
from selfmotion.basics.intervals import interval_of as interval_of
from selfmotion.basics.jit import (
    ALL_WORKS as ALL_WORKS,
    FIRST_WORKS as FIRST_WORKS,
    called as called,
    compile_alone as compile_alone,
    compile_in_background as compile_in_background,
    inlined as inlined,
    kernel as kernel,
    meanwhile as meanwhile,
    seconds_of_kernels as seconds_of_kernels,
    seconds_waited_for_kernels as seconds_waited_for_kernels,
)
from selfmotion.basics.nested_tables import (
    FORMER_CLEARANCE as FORMER_CLEARANCE,
    in_si as in_si,
    read_document as read_document,
    read_values as read_values,
    scaled as scaled,
    write_document as write_document,
)
from selfmotion.basics.progress import Progress as Progress, silent as silent
from selfmotion.basics.saved import (
    Saved as Saved,
    description_of as description_of,
    is_known as is_known,
    restore as restore,
)
from selfmotion.basics.tables import (
    LEFT_OUT as LEFT_OUT,
    read_rows as read_rows,
    read_table as read_table,
)
from selfmotion.basics.threads import one_blas_thread as one_blas_thread
from selfmotion.basics.units import (
    in_angle as in_angle,
    in_length as in_length,
)
