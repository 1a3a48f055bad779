"""The workshop with torch: networks, datasets, training, evaluation, export."""
