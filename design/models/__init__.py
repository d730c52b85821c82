"""Models: what a design rule needs of a plant, from reduced lags to gains of state feedback."""
