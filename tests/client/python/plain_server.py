"""A server as scene.proto has it, as plainly as can be: what the client is judged by. One thread, no gRPC."""
from __future__ import annotations

from typing import Any, Iterator, Optional

from voxeld.v1 import scene_pb2 as pb

REFUSED = "refuse this"  # the label of an entity that is to be refused

Scene = dict[str, dict[str, bytes]]  # layer → id → Entity, serialised


class Session:
    def __init__(self, token: bytes) -> None:
        self.token = token
        self.keeps = False
        self.scene: Scene = {}
        self.objects: dict[str, bytes] = {}
        self.states: dict[str, Any] = {}
        self.last_frame_id: Optional[int] = None
        self.last_sequence: Optional[int] = None


class PlainServer:
    """Sessions and streams. `window`: how many bytes may be sent and not applied; 0: credit is not spoken of."""

    def __init__(self, window: int = 0, displays: tuple[str, ...] = ("d",)) -> None:
        self.window = window
        self.displays = displays
        self.sessions: dict[bytes, Session] = {}
        self.tokens = 0
        self.now_ns = 1000
        self.commits: list[int] = []  # every frame id that was applied, in order
        self.client_drops = 0
        self.frames_seen = 0
        self.session: Optional[Session] = None

    def forget(self) -> None:
        """As after a restart."""
        self.sessions.clear()

    def begin(self) -> None:
        """A new stream."""
        self.session = None
        self.received = self.applied = 0
        self.credit = 0
        self.staged: list[pb.StreamRequest] = []
        self.sequence = 0
        self.opened = False

    def receive(self, message: bytes) -> list[pb.StreamResponse]:
        """Takes one request; raises LookupError where a real server ends the stream with NOT_FOUND."""
        # A message may exceed what is left only by being sent while some is left.
        assert not self.opened or not self.window or self.received < self.credit, (self.received, self.credit)
        self.received += len(message)
        self.sequence += 1
        request = pb.StreamRequest.FromString(message)
        what = request.WhichOneof("op")
        if not self.opened:
            assert what == "open", f"{what} before Opened"
            return [self._open(request.open)]
        assert what != "open"
        if what == "ping":
            return [pb.StreamResponse(pong=pb.Pong(client_time_ns=request.ping.client_time_ns,
                                                   received_time_ns=self.now_ns, server_time_ns=self.now_ns))]
        if what != "commit":
            self.staged.append(request)
            return []
        return [self._commit(request.commit)]

    def give_credit(self) -> list[pb.StreamResponse]:
        """For everything that has come: applied, or staged for a commit that has not."""
        if not self.window or self.credit >= self.received + self.window:
            return []
        self.credit = self.received + self.window
        return [pb.StreamResponse(credit_bytes=self.credit)]

    def _open(self, request: pb.Open) -> pb.StreamResponse:
        if request.resume_token:
            if request.resume_token not in self.sessions:
                raise LookupError("no such session")
            self.session = self.sessions.pop(request.resume_token)
            if not self.session.keeps:  # its layers went with its stream
                self.session.scene, self.session.states, self.session.objects = {}, {}, {}
        else:
            self.session = Session(b"")
        self.session.keeps = request.on_disconnect == pb.DISCONNECT_POLICY_KEEP
        self.tokens += 1
        self.session.token = f"token{self.tokens}".encode()
        self.sessions[self.session.token] = self.session
        self.opened = True
        self.credit = self.window
        opened = pb.Opened(session=self.tokens, resume_token=self.session.token, credit_bytes=self.window,
                           displays=self.displays, server_time_ns=self.now_ns)
        opened.limits.max_message_bytes = 16 << 20
        if request.resume_token and self.session.last_frame_id is not None:
            opened.last_frame_id = self.session.last_frame_id
            opened.last_sequence = self.session.last_sequence or 0
        return pb.StreamResponse(opened=opened)

    def _commit(self, commit: pb.Commit) -> pb.StreamResponse:
        assert self.session is not None
        frame: Optional[str] = None
        refused = []
        for request in self.staged:
            what = request.WhichOneof("op")
            if any(upsert.entity.label == REFUSED for upsert in upserts(request)):
                refused.append(request.upsert.id)
                continue
            if what == "frame_begin":
                assert frame is None
                frame = request.frame_begin.layer
                self.session.scene[frame] = {}
            elif what == "frame_end":
                assert frame == request.frame_end.layer
                frame = None
                self.frames_seen += 1
            else:
                apply(self.session, request)
        assert frame is None
        self.staged = []
        self.client_drops += commit.client_drops
        if commit.frame_id:
            self.commits.append(commit.frame_id)
        self.session.last_frame_id, self.session.last_sequence = commit.frame_id, self.sequence
        response = pb.StreamResponse(issues=[pb.Issue(id=id, message="refused") for id in refused])
        accepted = pb.Accepted(snapshot=len(self.commits), displays=self.displays, refused_operations=len(refused))
        response.receipts.add(frame_id=commit.frame_id, sequence=self.sequence, accepted=accepted)
        for display in self.displays:
            outcome = pb.Outcome(display=display, presented=pb.Presented(volume=1))
            response.receipts.add(frame_id=commit.frame_id, sequence=self.sequence, outcome=outcome)
        return response


def upserts(request: pb.StreamRequest) -> Iterator[pb.Upsert]:
    if request.HasField("upsert"):
        yield request.upsert
    yield from request.batch.upserts


def apply(session: Session, request: pb.StreamRequest) -> None:
    """A retained operation. An entity's transform is kept apart, as SetTransform changes it."""
    what = request.WhichOneof("op")
    if what in ("upsert", "batch"):
        for upsert in upserts(request):
            session.scene.setdefault(upsert.layer, {})[upsert.id] = upsert.entity.SerializeToString()
    elif what == "delete":
        layer = session.scene.setdefault(request.delete.layer, {}) if request.delete.layer else {}
        kind = request.delete.WhichOneof("what")
        if kind == "id":
            layer.pop(request.delete.id, None)
        elif kind == "all_of_layer":
            layer.clear()
        else:
            assert kind == "all_mine"
            for one in session.scene.values():
                one.clear()
    elif what == "set_transform":
        move = request.set_transform
        entity = pb.Entity.FromString(session.scene[move.layer][move.id])  # KeyError: an Issue
        entity.transform.CopyFrom(move.transform)
        session.scene[move.layer][move.id] = entity.SerializeToString()
    elif what == "layer_state":
        for field, value in request.layer_state.ListFields():
            if field.name != "layer":
                session.states[f"{request.layer_state.layer}.{field.name}"] = value
    elif what == "define_object":
        session.objects[request.define_object.object] = request.define_object.definition.SerializeToString()
    elif what == "delete_object":
        session.objects.pop(request.delete_object.object, None)
    else:
        raise AssertionError(what)
