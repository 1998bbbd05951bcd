"""What is known of plans, programs and margins, as one list that every output shows."""

from selfmotion.shell.facts.fact import (
    Fact as Fact,
    with_unit as with_unit,
)
from selfmotion.shell.facts.known import (
    certificate_facts as certificate_facts,
    facts_of_program as facts_of_program,
    finding_facts as finding_facts,
    margin_facts as margin_facts,
    plan_facts as plan_facts,
    program_facts as program_facts,
    without_repeats as without_repeats,
)
