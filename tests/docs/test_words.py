"""One noun, one thing: public names keep to the glossary, and texts to plain English."""

import inspect
import re

import pytest

import selfmotion as sm
from support.places import ROOT

GLOSSARY = (ROOT / "docs" / "pages" / "glossary.md").read_text()
# Phrases of no engineer's English, and words that only their authors understand.
BANNED = (
    *("so manieth", "as may be", "told of it", "a lot after the other", "where it would else"),
    *(
        "as is asked",
        "is told of",
        "are told of",
        "does without",
        "in vain",
        "of many a",
        "thereof",
    ),
    *("comes of it", "what is looked at", "be it that", "as many as it takes", "so far as may"),
)


def replaced() -> list[str]:
    """Return the single words that the glossary has another word for."""
    cells = re.findall(r"^\| [^|]+ \| [^|]+ \| ([^|]+) \|$", GLOSSARY, re.MULTILINE)
    words = [word.strip() for cell in cells[1:] for word in cell.split(",")]
    return [word for word in words if re.fullmatch(r"[a-z]+", word)]


def public_names() -> list[str]:
    """Return the names in `sm` and in its doors."""
    doors = {name: getattr(sm, name) for name in sm.__all__}
    inner = [x for door in doors.values() if inspect.ismodule(door) for x in door.__all__]
    return [*doors, *inner]


def words_of(name: str) -> list[str]:
    return [part.lower() for part in re.findall(r"[A-Z]?[a-z]+|[A-Z]+", name)]


def test_the_glossary_has_words_to_replace() -> None:
    assert {"knot", "reward"} <= set(replaced())


@pytest.mark.parametrize("word", replaced())
def test_no_public_name_uses_a_word_that_is_replaced(word: str) -> None:
    assert [name for name in public_names() if word in words_of(name)] == []


def test_a_replaced_word_is_found_in_a_name() -> None:
    assert "reward" in words_of("JointReward")
    assert "reward" in words_of("joint_reward")


def texts() -> dict[str, str]:
    """Return the texts of the sources and pages, in one line each."""
    files = [*ROOT.glob("src/**/*.py"), *ROOT.glob("docs/pages/**/*.md")]
    files += [ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    return {
        str(file.relative_to(ROOT)): re.sub(r"\s+(?:#\s)?", " ", file.read_text().lower())
        for file in files
    }


@pytest.mark.parametrize("phrase", BANNED)
def test_no_text_uses_a_banned_phrase(phrase: str) -> None:
    assert [name for name, text in texts().items() if phrase in text] == []
