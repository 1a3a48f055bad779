"""How well metres come from the vehicle's motion: flights with exact depth, recorded flights, KITTI."""
