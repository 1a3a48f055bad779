"""Embree 4 through its C interface, in the library that the embreex wheel carries.

embreex itself offers one ray a call. Packets of 16 neighbouring rays (8 without AVX-512) go through the same
tree about three times as fast, and rays from a camera or towards the sun are neighbours by nature.

Source of every structure and constant: the Embree 4 API reference and its headers rtcore_*.h.
"""

from __future__ import annotations

import ctypes
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, files
from typing import Any

import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from uavdepth.errors import SceneError

RAY_HIT_ROWS = 21
"""Rows of 32-bit numbers, one a ray, in an RTCRayHit4, 8 or 16; the first 12 are its rays."""

_ALIGNMENT = 64
_SCENE_ROBUST = 1 << 2
_RAYS_COHERENT = 1 << 16
_TRIANGLES = 0
_INDEX_BUFFER, _VERTEX_BUFFER = 0, 1
_FORMAT_UINT3, _FORMAT_FLOAT3 = 0x5003, 0x9003
_DEVICE_VERSION = 0
_NATIVE_PACKETS = {16: 34, 8: 33, 4: 32}
"""Device property that tells whether the processor takes packets of so many rays as they are."""

_POINTER = ctypes.c_void_p
_SIGNATURES: dict[str, tuple[object, tuple[object, ...]]] = {
    "rtcNewDevice": (_POINTER, (ctypes.c_char_p,)),
    "rtcGetDeviceError": (ctypes.c_int, (_POINTER,)),
    "rtcGetDeviceProperty": (ctypes.c_ssize_t, (_POINTER, ctypes.c_int)),
    "rtcNewScene": (_POINTER, (_POINTER,)),
    "rtcSetSceneFlags": (None, (_POINTER, ctypes.c_int)),
    "rtcCommitScene": (None, (_POINTER,)),
    "rtcReleaseScene": (None, (_POINTER,)),
    "rtcNewGeometry": (_POINTER, (_POINTER, ctypes.c_int)),
    "rtcSetSharedGeometryBuffer": (
        None,
        (
            _POINTER,
            ctypes.c_int,
            ctypes.c_uint,
            ctypes.c_int,
            _POINTER,
            ctypes.c_size_t,
            ctypes.c_size_t,
            ctypes.c_size_t,
        ),
    ),
    "rtcCommitGeometry": (None, (_POINTER,)),
    "rtcAttachGeometry": (ctypes.c_uint, (_POINTER, _POINTER)),
    "rtcReleaseGeometry": (None, (_POINTER,)),
}


class _QueryArguments(ctypes.Structure):
    """RTCIntersectArguments; RTCOccludedArguments has the same layout."""

    _fields_ = (
        ("flags", ctypes.c_int),
        ("feature_mask", ctypes.c_uint),
        ("context", _POINTER),
        ("filter", _POINTER),
        ("intersect", _POINTER),
    )


class EmbreeTriangles:
    """One triangle mesh in an Embree acceleration structure, watertight (Embree's robust mode).

    Args:
        vertices_m: (N, 3) float32.
        faces: (M, 3) int32 vertex numbers, all in range.
        packet: rays in one call, 4, 8 or 16; None takes what suits the processor.

    Attributes:
        vertices_m: (N, 3) float32, the copy that Embree reads.
        handle: the RTCScene.
        packet: rays in one call.
        intersect, occluded: addresses of rtcIntersect and rtcOccluded for so many rays.
        coherent, incoherent: addresses of query arguments for neighbouring and for unrelated rays.

    Raises:
        SceneError: Embree's library is not where the embreex wheel should have it, is not version 4,
            or reports an error.
    """

    def __init__(
        self, vertices_m: NDArray[np.float32], faces: NDArray[np.int32], packet: int | None = None
    ) -> None:
        library = _library()
        self._library = library
        self._device = _device()
        # Embree reads both in place, and the last vertex with a load of 16 bytes.
        self.vertices_m = np.zeros((len(vertices_m) + 1, 3), np.float32)[:-1]
        self.vertices_m[:] = vertices_m
        self._faces = np.ascontiguousarray(faces, np.int32)
        self.handle = int(library.rtcNewScene(self._device))
        library.rtcSetSceneFlags(self.handle, _SCENE_ROBUST)
        geometry = library.rtcNewGeometry(self._device, _TRIANGLES)
        for kind, form, items, count in (
            (_VERTEX_BUFFER, _FORMAT_FLOAT3, self.vertices_m, len(vertices_m)),
            (_INDEX_BUFFER, _FORMAT_UINT3, self._faces, len(faces)),
        ):
            library.rtcSetSharedGeometryBuffer(geometry, kind, 0, form, items.ctypes.data, 0, 12, count)
        library.rtcCommitGeometry(geometry)
        library.rtcAttachGeometry(self.handle, geometry)
        library.rtcReleaseGeometry(geometry)
        library.rtcCommitScene(self.handle)
        error = library.rtcGetDeviceError(self._device)
        if error:
            raise SceneError(f"Embree reports error {error} for a mesh of {len(faces)} triangles")
        self.packet = _packet() if packet is None else packet
        self.intersect = _address(f"rtcIntersect{self.packet}")
        self.occluded = _address(f"rtcOccluded{self.packet}")
        everything = 0xFFFFFFFF
        self._arguments = (
            _QueryArguments(_RAYS_COHERENT, everything, None, None, None),
            _QueryArguments(0, everything, None, None, None),
        )
        self.coherent, self.incoherent = (ctypes.addressof(each) for each in self._arguments)

    def __del__(self) -> None:
        if hasattr(self, "handle"):
            self._library.rtcReleaseScene(self.handle)


def aligned_rows(rows: int, packet: int) -> NDArray[np.float32]:
    """(rows, packet) float32 zeros at an address that Embree's packet calls accept."""
    size = rows * packet * 4
    room = np.zeros(size + _ALIGNMENT, np.uint8)
    skip = -room.ctypes.data % _ALIGNMENT
    return room[skip : skip + size].view(np.float32).reshape(rows, packet)


def _call_packet(typingctx, function, valid, scene, packet, arguments):  # type: ignore[no-untyped-def]
    """Call rtcIntersect or rtcOccluded for a packet, from compiled code, all by address.

    An address that is an argument, unlike a ctypes function, lets Numba keep the compiled code on disk.
    """
    signature = types.void(types.intp, types.intp, types.intp, types.intp, types.intp)

    def generate(context, builder, _, values):  # type: ignore[no-untyped-def]
        pointer = ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [pointer] * 4)
        target = builder.inttoptr(values[0], kind.as_pointer())
        builder.call(target, [builder.inttoptr(value, pointer) for value in values[1:]])
        return context.get_dummy_value()

    return signature, generate


call_packet: Any = intrinsic(_call_packet)


@lru_cache(maxsize=1)
def _library() -> ctypes.CDLL:
    try:
        listed = files("embreex") or []
    except PackageNotFoundError as error:
        raise SceneError("embreex is not installed: pip install 'uavdepth[sim]'") from error
    found = [path for path in listed if "embree4" in path.name]
    if not found:
        raise SceneError("the installed embreex carries no library of Embree 4: pip install -U embreex")
    library = ctypes.CDLL(str(found[0].locate()))
    for name, (result, arguments) in _SIGNATURES.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library


@lru_cache(maxsize=1)
def _device() -> int:
    """One device for the process. It builds on one thread: pictures may be drawn beside other work."""
    library = _library()
    device = library.rtcNewDevice(b"threads=1")
    if not device:
        raise SceneError(f"Embree does not start: error {library.rtcGetDeviceError(None)}")
    version = library.rtcGetDeviceProperty(device, _DEVICE_VERSION)
    if version // 10000 != 4:
        raise SceneError(f"Embree's version is {version}: 4xxxx is needed")
    return int(device)


@lru_cache(maxsize=1)
def _packet() -> int:
    library, device = _library(), _device()
    for packet, native in _NATIVE_PACKETS.items():
        if library.rtcGetDeviceProperty(device, native):
            return packet
    return min(_NATIVE_PACKETS)


def _address(name: str) -> int:
    function = getattr(_library(), name, None)
    address = None if function is None else ctypes.cast(function, _POINTER).value
    if address is None:
        raise SceneError(f"Embree's library has no {name}")
    return address
