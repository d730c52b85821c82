"""The one error of this package: what a recording or a plant holds that cannot be right."""


class IdentifyError(Exception):
    """A recording or a plant is wrong; the message names the file, row, column or key, the rule and the way out."""
