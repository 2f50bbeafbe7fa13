"""From how far away servoing converges, as in the paper's Fig. 6."""
