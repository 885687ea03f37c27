"""The exceptions of Pumice, sorted by who must act. Every message is one line that says what and where."""


from ._native import one_line


class PumiceError(Exception):
    """Base of all errors of Pumice. Its message is one line of bounded length, whatever names of files or labels it quotes."""

    def __init__(self, message: str = "") -> None:
        super().__init__(one_line(message))


class InputError(PumiceError, ValueError):
    """A file, an array, a scene or an argument is invalid."""


class Cancelled(PumiceError):
    """The job was cancelled; no partial result is left behind."""

    # It is also made while the interpreter ends, when no Python code can run any more.
    __init__ = Exception.__init__


class PumiceWarning(UserWarning):
    """A reader found something unusual in a file that is not an error."""


class InternalError(PumiceError):
    """A defect of Pumice: its compiled part panicked, and the panic was caught. The process continues; please report the text."""
