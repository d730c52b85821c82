"""The figure of the normal distribution that 95 % intervals are made of."""

NORMAL_95 = 1.959963984540054  # its 97.5 % point, in standard deviations
