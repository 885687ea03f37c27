"""The exceptions of Pumice, sorted by who must act. Every message is one line that says what and where."""


class PumiceError(Exception):
    """Base of all errors of Pumice."""


class InputError(PumiceError, ValueError):
    """A file, an array, a scene or an argument is invalid."""


class Cancelled(PumiceError):
    """The job was cancelled; no partial result is left behind."""


class PumiceWarning(UserWarning):
    """A reader found something unusual in a file that is not an error."""


class InternalError(PumiceError):
    """A defect of Pumice: its compiled part panicked, and the panic was caught. The process continues; please report the text."""
