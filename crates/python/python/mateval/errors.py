"""The exceptions of this package. All other wrong arguments raise Python's own ``TypeError`` or ``ValueError``."""


class Error(Exception):
    """Something could not be read, written or scored. The text is that of the command, with the codes of findings."""


class UnknownId(Error, KeyError):
    """A scene, view, instance, part or key that does not exist."""

    def __str__(self) -> str:
        # KeyError would show the text in quotation marks.
        return Exception.__str__(self)


class WrongShape(Error, ValueError):
    """An array whose shape or size does not fit what it is compared with or made into."""


class Withheld(Error):
    """Ground truth that this copy of the dataset does not hold."""
