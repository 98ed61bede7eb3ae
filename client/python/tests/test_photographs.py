"""Claim: a picture lies under a map as it was uploaded, and a photograph says where it was taken."""

from __future__ import annotations

import math

import pictures
import pytest
from conftest import Server

from waymark import Image, Pose2, Refused
from waymark.api import UnderlayPlace

QUARTER = math.pi / 2


def test_a_picture_lies_under_a_map_until_it_is_deleted(server: Server) -> None:
    plan = Image.rgb(pictures.poster(1))
    place = UnderlayPlace(0.05, -1.5, 2.0, theta_rad=-QUARTER)
    with server.maps() as maps:
        maps.create_map("planned")
        with pytest.raises(Refused) as none:
            maps.underlay("planned")
        assert none.value.code == "unknown_underlay"
        stored = maps.set_underlay("planned", plan, place)
        assert (stored.place, stored.width_px, stored.height_px) == (place, 480, 360)
        assert stored.image_kind == "png" and maps.underlay("planned") == stored
        assert maps.underlay_image("planned") == plan.png().data
        photo = plan.jpeg()
        replaced = maps.set_underlay("planned", photo, UnderlayPlace(1e-3))
        assert (replaced.image_kind, replaced.place) == ("jpeg", UnderlayPlace(0.001, 0.0, 0.0, 0.0))
        assert maps.underlay_image("planned") == photo.data
        with pytest.raises(Refused) as coarse:
            maps.set_underlay("planned", plan, UnderlayPlace(11.0))
        assert (coarse.value.code, coarse.value.field) == ("out_of_range", "underlay.metres_per_pixel")
        maps.delete_underlay("planned")
        with pytest.raises(Refused):
            maps.underlay_image("planned")


def test_a_photograph_says_where_it_was_taken(server: Server, taught: str) -> None:
    x_m, distance_m = 5.4, 2.0
    photo = Image.rgb(pictures.seen_from(Pose2(x_m, distance_m, -QUARTER - 0.15)))
    with server.maps() as maps:
        assert maps.recognise(taught, photo).camera_pose is None, "without intrinsics"
        answer = maps.recognise(taught, photo, pictures.CAMERA)
        found = answer.camera_pose
        assert found is not None and found.map_from_camera is not None, answer
        at = found.map_from_camera
        assert math.dist((at.x_m, at.y_m, at.z_m), (x_m, distance_m, pictures.CAMERA_HEIGHT_M)) < 0.1
        assert (found.landmarks, len(found.covariance), answer.camera_pose_refusal) == (("poster-0",), 36, "")
        unplaced = maps.recognise(taught, pictures.teaching_photo(1), pictures.CAMERA)
        assert (unplaced.camera_pose, unplaced.camera_pose_refusal) == (None, "landmark_not_placed")
