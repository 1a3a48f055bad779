"""Training pictures with exact depth: rendering, storage, augmentation and batches."""
