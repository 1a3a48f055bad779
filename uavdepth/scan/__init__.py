"""From depth to obstacles round the nose, and what happens to them from picture to picture."""
