"""What is masked is unknown: no landing leg is an obstacle, and nothing behind it is clear."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from elements import element, obstacles
from solids import depth_of, pole, wall

from uavdepth import ImageSizeError, ObstacleScanner, SectorState
from uavdepth.errors import ImageMaskError
from uavdepth.scan.image_mask import load_image_mask

CLEAR, UNKNOWN = SectorState.CLEAR, SectorState.UNKNOWN


@pytest.fixture
def leg(camera):
    """(H, W) bool: a landing leg that reaches up into the picture right of the middle."""
    mask = np.zeros((camera.height, camera.width), np.bool_)
    mask[40:, 440:490] = True
    return mask


class TestScan:
    def test_r20_a_masked_leg_is_unknown_and_not_an_obstacle_at_its_distance(self, camera, mount, level, leg):
        depth = np.full(leg.shape, np.inf, np.float32)
        depth[leg] = 0.3
        assert ObstacleScanner(camera, mount).scan(depth, level).nearest_m == pytest.approx(0.3, rel=0.1)
        scan = ObstacleScanner(camera, mount, mask=leg).scan(depth, level)
        assert obstacles(scan) == []
        assert (scan.state[[element(20), element(25)]] == UNKNOWN).all()
        assert (scan.state[[element(0), element(10), element(35)]] == CLEAR).all()

    def test_r20_behind_the_mask_nothing_is_known_and_beside_it_everything(self, camera, mount, level, leg):
        depth = depth_of([pole(22, 6.0, 0.05), pole(-20, 7.0, 0.1)], camera, mount, level)
        leg[:] |= np.roll(leg, 5, axis=1)
        leg[:40] |= leg[40]
        scan = ObstacleScanner(camera, mount, mask=leg).scan(depth, level)
        assert obstacles(scan) == [element(-20)]
        assert scan.state[element(20)] == UNKNOWN

    def test_r20_a_wall_shows_round_the_mask(self, camera, mount, level, leg):
        scan = ObstacleScanner(camera, mount, mask=leg).scan(depth_of([wall(6)], camera, mount, level), level)
        assert scan.distance_m[element(30)] == pytest.approx(6 / np.cos(np.radians(27.5)), rel=0.03)
        assert set(obstacles(scan)) >= {element(15), element(30)}

    def test_a_mask_of_another_size_is_refused(self, camera, mount):
        with pytest.raises(ImageSizeError, match=r"mask's shape is \(192, 384\).*\(320, 640\)"):
            ObstacleScanner(camera, mount, mask=np.zeros((192, 384), np.bool_))

    def test_a_mask_changed_afterwards_does_not_change_the_scanner(self, camera, mount, level):
        mask = np.zeros((camera.height, camera.width), np.bool_)
        scanner = ObstacleScanner(camera, mount, mask=mask)
        mask[:] = True
        assert obstacles(scanner.scan(depth_of([wall(6)], camera, mount, level), level))


class TestFile:
    def test_black_is_masked_and_white_is_looked_at(self, camera, leg, tmp_path):
        file = tmp_path / "mask.png"
        cv2.imwrite(str(file), np.where(leg, 0, 255).astype(np.uint8))
        np.testing.assert_array_equal(load_image_mask(file, camera), leg)

    def test_a_coloured_picture_saved_with_losses_will_do(self, camera, leg, tmp_path):
        file = tmp_path / "mask.jpg"
        cv2.imwrite(str(file), np.where(leg, 0, 255).astype(np.uint8)[..., None].repeat(3, axis=2))
        np.testing.assert_array_equal(load_image_mask(str(file), camera), leg)

    def test_another_size_is_refused_with_both(self, camera, tmp_path):
        file = tmp_path / "mask.png"
        cv2.imwrite(str(file), np.full((480, 640), 255, np.uint8))
        with pytest.raises(ImageMaskError, match=r"mask\.png is 640x480 pixels, the camera is 640x320"):
            load_image_mask(file, camera)

    def test_a_mask_that_leaves_nothing_to_see_is_refused(self, camera, tmp_path):
        file = tmp_path / "mask.png"
        cv2.imwrite(str(file), np.zeros((320, 640), np.uint8))
        with pytest.raises(ImageMaskError, match="black everywhere"):
            load_image_mask(file, camera)

    @pytest.mark.parametrize("content", [b"", b"\x89PNG\r\n\x1a\n broken", b"camera = 1\n"])
    def test_what_is_no_picture_is_refused_by_name(self, camera, tmp_path, content):
        file = tmp_path / "mask.png"
        file.write_bytes(content)
        with pytest.raises(ImageMaskError, match=r"mask\.png is no picture"):
            load_image_mask(file, camera)

    def test_a_missing_file_and_a_folder_are_refused_with_the_reason(self, camera, tmp_path):
        with pytest.raises(ImageMaskError, match=r"nowhere\.png cannot be read: No such file"):
            load_image_mask(tmp_path / "nowhere.png", camera)
        with pytest.raises(ImageMaskError, match="cannot be read: Is a directory"):
            load_image_mask(tmp_path, camera)
