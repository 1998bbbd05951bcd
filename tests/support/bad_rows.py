"""What a row of the table of bad inputs is, and what the user sees of it."""

import re
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import selfmotion as sm

_PACKAGE = str(Path(sm.__file__).parent)


@dataclass(frozen=True)
class Row:
    """One bad input.

    Attributes
    ----------
    area : str
        The section of the table.
    given : str
        What is wrong, as the user would say it; each once.
    call : callable
        Does it, given an empty folder.
    """

    area: str
    given: str
    call: Callable[[Path], object]

    def seen(self, folder: Path) -> str:
        """Return what the user sees: the error's type and text, without the folder's name.

        Raises
        ------
        AssertionError
            The call succeeds, or the error is not one of ours.
        """
        try:
            made = self.call(folder)
        except sm.SelfmotionError as error:
            return self._plain(error, folder)
        except (ValueError, TypeError) as error:
            # Ours say what is wrong; those of other packages and of Python are about their own.
            last = traceback.extract_tb(error.__traceback__)[-1]
            if not (last.filename.startswith(_PACKAGE) and str(last.line).startswith("raise")):
                raise AssertionError(f"{self.given}: {last.filename}: {error!r}") from error
            return self._plain(error, folder)
        except Exception as error:
            raise AssertionError(f"{self.given}: {error!r}") from error
        raise AssertionError(f"{self.given}: nothing is raised; {made!r}")

    @staticmethod
    def _plain(error: Exception, folder: Path) -> str:
        text = " ".join(str(error).split()).replace(f"{folder}/", "").replace(str(folder), "FOLDER")
        text = re.sub(r"/[^\s:']*/(?=[^/\s:']+\.urdf)", "", text)  # where arms are installed
        return f"{type(error).__name__}: {text}"
