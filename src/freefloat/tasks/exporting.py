"""The work of ``export``: which motion, at which times, where to and as what."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.text import Text

from freefloat.errors import InputError
from freefloat.io.export import Format, save_trajectory, trajectory_text
from freefloat.io.files import refuse_same_files
from freefloat.io.plan_file import load_plan
from freefloat.io.trajectory import Trajectory, even_times, times_at_rate
from freefloat.motion.motion import Motion

_TIMES = 501
_STDOUT = "-"


@dataclass(frozen=True)
class Export:
    """What is asked.

    Attributes:
        source: The plan or motion file.
        format: As what.
        output: Where to; None for stdout.
        rate: Times a second [Hz], or None.
        times: How many, or None.
    """

    source: Path
    format: Format
    output: Path | None
    rate: float | None
    times: int | None

    @classmethod
    def of(
        cls,
        source: Path,
        format_: str | None,
        output: str | None,
        rate: float | None,
        times: int | None,
        as_json: bool,
    ) -> Export:
        """Check the words of a command line.

        Raises:
            InputError: If they do not go together.
        """
        if rate is not None and times is not None:
            raise InputError("rate", f"{rate:g} was given, and times, too", "rate or times")
        to_stdout = output == _STDOUT
        if output == "":
            raise InputError("output", "an empty name was given", "the name of a file")
        if to_stdout and as_json:
            raise InputError("output", "- was given, and --json, too", "one of the two")
        given = None if output is None or to_stdout else Path(output)
        if given is not None:
            refuse_same_files(file=source, output=given)
        kind = _format(format_) or Format.of(given)
        if kind is None and given is not None and given.suffix:
            endings = ", ".join(one.suffix for one in Format)
            raise InputError(
                "output", f"{given} was given", f"a name that ends in {endings}; or --format"
            )
        kind = kind or Format.CSV
        if to_stdout:
            if kind is Format.MAT:
                raise InputError("output", "- was given for mat, which is no text", "a file")
            return cls(source, kind, None, rate, times)
        file = given or Path(f"{source.stem}_trajectory{kind.suffix}")
        refuse_same_files(file=source, output=file)
        return cls(source, kind, file, rate, times)

    def carry_out(self) -> tuple[dict[str, Any], str | None]:
        """Do it.

        Returns:
            What was done, and the text for stdout where it goes there.

        Raises:
            InputError: If the file holds no motion, or the format cannot tell it, or the output
                cannot be written.
        """
        motion = self._motion()
        if self.rate is not None:
            times = times_at_rate(motion, self.rate)
        else:
            times = even_times(motion, _TIMES if self.times is None else self.times)
        found = Trajectory.of(motion, times)
        if self.output is None:
            return {}, trajectory_text(motion, found, self.format)
        save_trajectory(self.output, motion, found, self.format)
        document = {
            "file": str(self.output),
            "format": str(self.format),
            "times": len(times),
            "from": float(times[0]),
            "to": float(times[-1]),
            "joint_names": list(motion.problem.model.joint_names),
            "completed": motion.completed,
        }
        return document, None

    def _motion(self) -> Motion:
        stored = load_plan(self.source)
        motion = stored.motion()
        if motion is None:
            raise InputError(
                "file", f"its plan has no motion: {stored.document.get('reason')}",
                "a plan with a motion, or a motion", str(self.source),
            )  # fmt: skip
        return motion


def _format(given: str | None) -> Format | None:
    if given is None:
        return None
    if given not in list(Format):
        raise InputError("format", f"{given!r} was given", ", ".join(Format))
    return Format(given)


def export_tables(document: dict[str, Any]) -> Sequence[Text]:
    """The document of an export for people."""
    told = (
        f"{document['times']:,} times from {document['from']:g} to {document['to']:g} s "
        f"written to {document['file']} ({document['format']})"
    )
    if document["completed"]:
        return [Text(told)]
    return [Text(told), Text("The motion does not follow its whole path.")]
