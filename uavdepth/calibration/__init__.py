"""From pictures of a printed board to the camera's intrinsics, with what they are worth."""
