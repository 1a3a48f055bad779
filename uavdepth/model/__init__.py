"""The depth network: its file and card, what it is told, and what comes out."""
