"""What Grimaldi says when the input is wrong: one line that names the place and the remedy."""


class InputError(ValueError):
    """Wrong input: the message is one line with the file or parameter, what is wrong there and what to do.

    The command line prints it and exits with 2.
    """


class NotYet(InputError):
    """Right input that Grimaldi cannot compute yet; better refused than computed wrongly."""


class GrimaldiWarning(UserWarning):
    """Something the picture leaves out or cannot show, said once."""
