"""The errors a user can cause; each is one line that says what was asked, found, exists, to do."""


class Par4Error(Exception):
    """Bad input, described in one line fit for a user; base of every error this project raises."""


class UnreachableError(Par4Error):
    """A pose that a leg cannot reach, or joint angles with which the mechanism does not close."""


class InputError(Par4Error):
    """A file, parameter or message that breaks the contract."""
