"""The one error of this package: what a recording or a plant holds that cannot be right."""


class IdentifyError(Exception):
    """A recording or a plant is wrong; the message names the file, row, column or key, the rule and the way out.

    `paste` is what to write into the project file instead, where a few lines of it are the cure.
    """

    def __init__(self, message: str, paste: str = "") -> None:
        super().__init__(message)
        self.paste = paste

    def __str__(self) -> str:
        """Return the message, and the lines to paste below it."""
        return (
            f"{self.args[0]}; write in the project, below its own headings:\n{self.paste}"
            if self.paste
            else str(self.args[0])
        )
