"""The errors that gaitchain raises: one root, each message a complete answer."""


class GaitchainError(Exception):
    """Root of every error that gaitchain raises on purpose."""


class RobotFileError(GaitchainError):
    """A robot file is missing, unreadable, or holds a value that cannot be."""


class UnreachableError(GaitchainError):
    """A primitive was asked for a target outside the reach of the leg."""


class ChainError(GaitchainError):
    """A Markov chain or its training data is not consistent."""


class LibraryError(GaitchainError):
    """A gait library is damaged, foreign, or not qualified for the task."""


class RenderError(GaitchainError):
    """This computer cannot render pictures."""


class CommandError(GaitchainError):
    """A command or an option cannot be carried out."""


class RecordError(GaitchainError):
    """A walk's record cannot be written, or its file cannot be read."""


class BackendError(GaitchainError):
    """A robot cannot be reached, or is not what it is said to be."""


class CalibrationError(GaitchainError):
    """A calibration file is missing, unreadable, or holds a value that cannot be."""


class LogError(GaitchainError):
    """A log cannot be written or read."""


class ServiceError(GaitchainError):
    """The service cannot be started as asked."""
