"""Every benchmark that a target runs has a short form, or a reason for none."""

import short


def test_every_target_has_a_short_form_or_a_reason() -> None:
    known = {**short.SHORT, **short.WHOLE}
    # As many as the Makefile has, and no line of what is gone.
    assert sorted(known) == sorted(short.targets())
    assert not set(short.SHORT) & set(short.WHOLE)
    assert all((short.HERE / name).is_file() for name in known)
