"""Calls beside the stream: displays, statistics, captures, scene contents. They block."""
from __future__ import annotations

import time
from typing import Any, Callable, Iterator, Optional, Sequence

import grpc
from google.protobuf.message import Message

from . import credentials
from .assets import Asset, Content, pack
from .credentials import Credentials
from .errors import ConnectionLost, VoxelError
from .v1 import display_pb2, scene_pb2
from .volumes import Volume

_PIECE_BYTES = 256 << 10
_GOES_ON = (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.ABORTED, grpc.StatusCode.OUT_OF_RANGE, grpc.StatusCode.DEADLINE_EXCEEDED)
_DISPLAYS = "/voxeld.v1.DisplayService/"
_SCENE = "/voxeld.v1.SceneService/"


def _failed(error: grpc.RpcError) -> VoxelError:
    return VoxelError(f"{error.code().name.lower()}: {error.details()}")


class Queries:
    """Uses a channel of its own, so that calls neither wait for the stream's bulk data nor end with it."""

    def __init__(self, server: str, who: Credentials) -> None:
        self._metadata = credentials.metadata(server, who)
        self._channel = credentials.open_channel(server, who, [
            ("grpc.max_receive_message_length", -1), ("grpc.use_local_subchannel_pool", 1),
            # The minimum is also the limit of one attempt, on slow networks and busy machines too; a refused attempt ends at
            # once.
            ("grpc.initial_reconnect_backoff_ms", 100), ("grpc.min_reconnect_backoff_ms", 10_000),
            ("grpc.max_reconnect_backoff_ms", 1000)])
        self._closed = False

    def close(self) -> None:
        self._closed = True
        self._channel.close()

    def _usable(self) -> grpc.Channel:
        if self._closed:
            raise ConnectionLost("the connection is closed")
        return self._channel

    def _one(self, method: str, request: Message, answer: Callable[[bytes], Any], timeout: Optional[float]) -> Any:
        call = self._usable().unary_unary(method, type(request).SerializeToString, answer)
        try:
            return call(request, timeout=timeout, metadata=self._metadata)
        except grpc.RpcError as error:
            raise _failed(error) from None

    def _stream(self, method: str, request: Message, answer: Callable[[bytes], Any],
                timeout: Optional[float]) -> Iterator[Any]:
        call = self._usable().unary_stream(method, type(request).SerializeToString, answer)(
            request, timeout=timeout, metadata=self._metadata)
        try:
            yield from call
        except grpc.RpcError as error:
            raise _failed(error) from None
        finally:
            call.cancel()

    def displays(self, timeout: Optional[float] = 5.0) -> list[display_pb2.DisplayDescription]:
        answer: display_pb2.ListDisplaysResponse = self._one(
            _DISPLAYS + "ListDisplays", display_pb2.ListDisplaysRequest(),
            display_pb2.ListDisplaysResponse.FromString, timeout)
        return list(answer.displays)

    def stats(self, timeout: Optional[float] = 5.0) -> display_pb2.Stats:
        for stats in self._stream(_DISPLAYS + "WatchStats", display_pb2.WatchStatsRequest(once=True),
                                  display_pb2.Stats.FromString, timeout):
            assert isinstance(stats, display_pb2.Stats)
            return stats
        raise VoxelError("the server gave no statistics")

    def capture(self, display: str = "", at_least_snapshot: int = 0, timeout: float = 10.0) -> Volume:
        request = display_pb2.CaptureVolumeRequest(
            name=display, timeout_ns=int(timeout * 1e9), at_least_snapshot=at_least_snapshot)
        return Volume.of(self._stream(_DISPLAYS + "CaptureVolume", request, display_pb2.VolumeChunk.FromString, timeout + 1))

    def entities(self, layer: str = "", prefix: str = "", owner: int = 0,
                 timeout: Optional[float] = 5.0) -> list[scene_pb2.EntityInfo]:
        result: list[scene_pb2.EntityInfo] = []
        token = ""
        while True:
            answer: scene_pb2.ListEntitiesResponse = self._one(
                _SCENE + "ListEntities",
                scene_pb2.ListEntitiesRequest(owner=owner, layer=layer, id_prefix=prefix, page_token=token),
                scene_pb2.ListEntitiesResponse.FromString, timeout)
            result += answer.entities
            token = answer.next_page_token
            if not token:
                return result

    def layers(self, owner: int = 0, timeout: Optional[float] = 5.0) -> list[scene_pb2.LayerInfo]:
        answer: scene_pb2.ListEntitiesResponse = self._one(
            _SCENE + "ListEntities", scene_pb2.ListEntitiesRequest(owner=owner, page_size=1),
            scene_pb2.ListEntitiesResponse.FromString, timeout)
        return list(answer.layers)

    def watch(self, layer: str = "", owner: int = 0, contents: bool = False,
              timeout: Optional[float] = None) -> "Watch":
        request = scene_pb2.WatchSceneRequest(owner=owner, layer=layer, contents=contents)
        return Watch(self._usable().unary_stream(
            _SCENE + "WatchScene", scene_pb2.WatchSceneRequest.SerializeToString,
            scene_pb2.WatchSceneResponse.FromString)(request, timeout=timeout))


    def assets(self, digests: Sequence[bytes] = (), timeout: Optional[float] = 5.0) -> list[scene_pb2.AssetInfo]:
        answer: scene_pb2.ListAssetsResponse = self._one(
            _SCENE + "ListAssets", scene_pb2.ListAssetsRequest(sha256=digests), scene_pb2.ListAssetsResponse.FromString, timeout)
        return list(answer.assets)

    def upload(self, content: Content, progress: Optional[Callable[[int, int], None]] = None, patience: float = 15.0) -> Asset:
        data, asset = pack(content)
        call = self._usable()
        ask = call.unary_unary(_SCENE + "ListAssets", scene_pb2.ListAssetsRequest.SerializeToString,
                               scene_pb2.ListAssetsResponse.FromString)
        send = call.stream_unary(_SCENE + "UploadAsset", scene_pb2.UploadAssetRequest.SerializeToString,
                                 scene_pb2.UploadAssetResponse.FromString)
        stored, restart, moved = 0, False, time.monotonic()
        while True:
            start = 0
            try:
                answer: scene_pb2.ListAssetsResponse = ask(scene_pb2.ListAssetsRequest(sha256=[asset.sha256]), timeout=patience,
                                                           metadata=self._metadata, wait_for_ready=True)
                there = answer.assets[0]
                if there.complete:
                    return asset
                if there.stored > stored:
                    moved = time.monotonic()
                stored = there.stored
                start = 0 if restart or stored >= len(data) else stored
                send(_upload_pieces(data, asset, start, min(_PIECE_BYTES, answer.max_piece_bytes), progress), metadata=self._metadata)
                return asset
            except grpc.RpcError as error:
                if error.code() == grpc.StatusCode.DATA_LOSS and start > 0:
                    restart = True  # the stored part has other bytes
                elif error.code() not in _GOES_ON or time.monotonic() - moved >= patience:
                    raise _failed(error) from None
            time.sleep(0.1)


def _upload_pieces(data: bytes, asset: Asset, start: int, size: int,
                   progress: Optional[Callable[[int, int], None]]) -> Iterator[scene_pb2.UploadAssetRequest]:
    for at in range(start, len(data), size):
        piece = data[at:at + size]
        first = at == start
        yield scene_pb2.UploadAssetRequest(sha256=asset.sha256 if first else b"", size=len(data) if first else 0, offset=at, data=piece)
        if progress is not None:
            progress(at + len(piece), len(data))


class Watch(Iterator["ChangeSet"]):
    """Change sets as they come. close() ends the call from any thread, and also a wait for the next one."""

    def __init__(self, call: Any) -> None:
        self._call = call
        self._closed = False

    def __next__(self) -> "ChangeSet":
        parts: list[scene_pb2.WatchSceneResponse] = []
        try:
            for answer in self._call:
                parts.append(answer)
                if answer.in_sync:
                    return ChangeSet(parts)
        except grpc.RpcError as error:
            if not self._closed:
                raise _failed(error) from None
        raise StopIteration

    def next(self) -> Optional["ChangeSet"]:
        """Returns the next change set, or None at the end."""
        return next(self, None)

    def close(self) -> None:
        self._closed = True
        self._call.cancel()

    def __del__(self) -> None:
        self.close()


class ChangeSet:
    """The additions and removals in the scene from one snapshot to another; the first holds the whole scene."""

    def __init__(self, parts: Sequence[scene_pb2.WatchSceneResponse]) -> None:
        self.snapshot = parts[-1].in_sync
        self.layers = [one for part in parts for one in part.layers]
        self.entities = [one for part in parts for one in part.entities]
        self.objects = [one for part in parts for one in part.objects]
        self.removed_layers = [one for part in parts for one in part.removed_layers]
        self.removed_entities = [one for part in parts for one in part.removed_entities]
        self.removed_objects = [one for part in parts for one in part.removed_objects]

    def __repr__(self) -> str:
        return (f"<snapshot {self.snapshot}: {len(self.entities)} entities, {len(self.layers)} layers new or changed; "
                f"{len(self.removed_entities)} entities, {len(self.removed_layers)} layers gone>")
