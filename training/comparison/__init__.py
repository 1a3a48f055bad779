"""The paper's comparison (table 3, figure 6) on rendered flights, every network trained alike."""
