"""What can go wrong, sorted by who must act. Every message is one line: what and where."""


class PumiceError(Exception):
    """Base of all errors of Pumice."""


class InputError(PumiceError, ValueError):
    """A file, an array, a scene or an argument is not what it should be."""


class Cancelled(PumiceError):
    """The job was cancelled; nothing was left behind."""


class PumiceWarning(UserWarning):
    """A reader found something odd in a file that is no error."""


class InternalError(PumiceError):
    """A defect of Pumice: a panic in its compiled part, caught. The process lives on; please report the text."""
