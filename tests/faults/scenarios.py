"""Ten core scenarios: lives of the real voxeld (life.py) in which tests make something fail."""
import contextlib
import hashlib
import os
import select
import signal
import socket
import subprocess
import sys
import urllib.request
from pathlib import Path
from typing import Any, Optional

import grpc
import numpy as np
import voxeld as voxel
from google.protobuf.message import Message
from voxeld.v1 import display_pb2, scene_pb2

from life import PATIENCE, Life, end, free_port
from polling import until
from relay import Relay

TOKEN = "a-token-of-this-test-alone"


def ask(channel: grpc.Channel, method: str, request: Message, answer: type[Message], token: str = "") -> Any:
    """Makes one call, such as DisplayService/ListDisplays."""
    call = channel.unary_unary(f"/voxeld.v1.{method}", type(request).SerializeToString, answer.FromString)
    return call(request, timeout=PATIENCE, metadata=(("authorization", f"Bearer {token}"),) if token else ())


class Draws(Life):
    """Ends with a red ball that must be visible if it was reported as shown."""

    def capture(self, display: str = "stack") -> None:
        with self.connect(name="five", on_disconnect=30.0) as v:  # what is shown stays visible if the connection is lost in the meantime
            v.layer("last", order=9).sphere("ball", radius=0.3, color="red", fill="solid")
            frame = v.commit()
            outcomes = frame.wait_shown(timeout=PATIENCE)
            assert frame.accepted is not None
            picture = v.capture(display, at_least_snapshot=frame.accepted.snapshot, timeout=PATIENCE).rgb
            red = (picture[..., 0] > 100) & (picture[..., 1] < 50)
            if display in outcomes and outcomes[display].kind == "presented" and not red.any():
                raise RuntimeError("it was told to be shown, and is not")
            self.told.shown = bool(red.any())

    def durable(self) -> None:
        v = self.connect(name="two", on_disconnect="keep")
        try:
            v.layer("stays").box("box", size=(1, 1, 1), color="white", fill="solid")
            frame = v.commit(durable=True).wait_durable(PATIENCE)
            self.told.durable = bool(frame.durable)
        finally:
            v.close(PATIENCE)

    def until(self, metric: str, least: float) -> None:
        until(lambda: self.metric(metric) >= least, f"{metric} is {least:g}", PATIENCE)

    def metric(self, name: str) -> float:
        with urllib.request.urlopen(f"http://127.0.0.1:{self.port}/metrics", timeout=PATIENCE) as answer:
            lines = answer.read().decode().splitlines()
        return sum(float(line.rpartition(" ")[2]) for line in lines if line.startswith(name))


class Ordinary(Draws):
    about = "start; drawing with receipts; a durable commit; lifetimes; an asset; the page, metrics and health; reloading; a capture; the end"
    steps = ("draw", "durable", "lifetimes", "asset", "page", "reload", "capture")
    keeps = from_start = True

    def lifetimes(self) -> None:
        with self.connect(name="three") as v:
            ball = v.sphere("brief", radius=0.2, color="green")
            ball.transform = voxel.translate(0.1, 0, 0)
            v.commit().wait_shown(timeout=PATIENCE)
            v.entities()
            v.layers()

    def asset(self) -> None:
        with self.connect(name="four") as v:
            v.upload(bytes(200_000))

    def page(self) -> None:
        for path in ("/healthz", "/metrics", "/"):
            with urllib.request.urlopen(f"http://127.0.0.1:{self.port}{path}", timeout=PATIENCE) as answer:
                assert answer.read()

    def reload(self) -> None:
        os.kill(self.pid, signal.SIGHUP)


class Streams(Draws):
    about = "two clients that stream: objects and their instances, a cloud that moves, layers that fade, immediate frames, timed commits"
    steps = ("stream", "capture")

    def stream(self) -> None:
        with self.connect(name="one") as one, self.connect(name="other", strict=True) as other:
            with one.object("gem") as gem:
                gem.box("top", size=(0.2, 0.2, 0.2), color="yellow")
                gem.sphere("middle", radius=0.1, color="white")
            handle = other.points("cloud", np.random.default_rng(1).random((2000, 3), np.float32))
            frames = []
            for turn in range(20):
                one.instance("gem", of="gem", transform=voxel.translate(turn / 40, 0, 0))
                one.layer("fades", opacity=1 - turn / 40).box("box", size=(0.1, 0.2, 0.3 + turn / 50), color="blue")
                frames.append(one.commit(present_in=0.02) if turn % 7 == 3 else one.commit())
                handle.transform = voxel.translate(0, turn / 50, 0)
                frames.append(other.commit())
                with other.frame("immediate") as immediate:
                    immediate.lines("line", np.array([[0, 0, 0], [1, turn / 20, 0]]), colors="cyan")
            one.remove_object("gem", cascade=True)
            frames.append(one.commit())
            for frame in frames:
                assert frame.wait_shown(timeout=PATIENCE)


class Resumed(Draws):
    about = "a client whose connection is cut twice, and taken up again"
    steps = ("cut", "capture")

    def listens(self) -> list[str]:
        self.tcp = free_port()
        return [f"127.0.0.1:{self.tcp}"]

    def cut(self) -> None:
        with contextlib.closing(Relay(("127.0.0.1", self.tcp))) as relay, voxel.connect(f"127.0.0.1:{relay.port}", timeout=PATIENCE, name="cut") as v:
            frames = []
            for turn in range(15):
                v.sphere("ball", radius=0.1 + turn / 50, color="green")
                frames.append(v.commit())
                if turn % 6 == 5:
                    frames[-1].wait(PATIENCE)
                    assert relay.cut() > 0
            # Outcomes that were under way at the disconnect are reported to nobody; that a commit was accepted is reported.
            for frame in frames:
                frame.wait(PATIENCE)
            assert frames[-1].wait_shown(timeout=PATIENCE)


class Kept(Draws):
    about = "a start with what is kept; it is read, changed and in part removed, durably"
    steps = ("found", "change", "capture")
    keeps = from_start = True

    def prepare(self) -> None:
        before = Kept(self.folder)
        process = before.start()
        assert before.ready(process), before.said()
        before.durable()
        with before.connect(name="many", on_disconnect="keep") as v:
            for number in range(60):
                v.layer(f"kept {number % 3}").box(f"box {number}", size=(0.1, 0.1, 0.1 + number / 60), color="blue")
            with v.object("thing") as thing:
                thing.sphere("all", radius=0.2, color="red")
            v.layer("kept 0").instance("one", of="thing")
            assert v.commit(durable=True).wait_durable(PATIENCE).durable
        assert end(process, process.pid) == 0, before.said()
        self.told.durable = True

    def found(self) -> None:
        with self.connect(name="reads") as v:
            found = {entity.key.id for entity in v.entities()}
            if not {"box", "one", *(f"box {number}" for number in range(60))} <= found:
                raise RuntimeError(f"what was told to be durable is not there: {sorted(found)}")

    def change(self) -> None:
        """A change that is under way when it fails counts neither as kept nor as gone."""
        v = self.connect(name="changes", on_disconnect="keep")
        told = self.told
        try:
            for number in range(10):
                name = f"new {number}"
                v.layer("new").box(name, size=(0.1, 0.1, 0.1), color="green")
                if v.commit(durable=True).wait_durable(PATIENCE).durable:
                    told.kept.add(name)
            for number in range(5):
                name = f"new {number}"
                told.kept.discard(name)
                v.layer("new").remove(name)
                if v.commit(durable=True).wait_durable(PATIENCE).durable:
                    told.gone.add(name)
        finally:
            v.close(PATIENCE)


class Assets(Draws):
    about = "assets: uploaded, known the second time, drawn as volumes, listed"
    steps = ("uploads", "capture")

    def uploads(self) -> None:
        with self.connect(name="four") as v:
            field = np.linspace(0, 1, 48**3, dtype=np.float32).reshape(48, 48, 48)
            asset = v.upload(field)
            assert v.upload(field) == asset
            v.upload(os.urandom(3_000_000))
            v.grid("grid", asset, values=[0.5, 1], cmap="magma")
            v.isosurface("level", asset, 0.3, color="white")
            assert v.commit().wait_shown(timeout=PATIENCE)


class Secured(Draws):
    about = "TLS: clients by certificate and by token, one who is turned away, a certificate that is exchanged"
    steps = ("by_certificate", "turned_away", "exchanged", "by_token", "capture")
    from_start = True

    def prepare(self) -> None:
        for name in ("first", "second"):
            subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "2", "-subj", f"/CN={name}",
                            "-addext", "subjectAltName=DNS:display.example", "-keyout", f"{self.folder}/{name}.key", "-out", f"{self.folder}/{name}.pem"],
                           check=True, capture_output=True)
        grants = self.folder / "grants.toml"
        digest = hashlib.sha256(TOKEN.encode()).hexdigest()
        grants.write_text('[[certificate]]\nname = "all"\nsubject = "first"\nscopes = ["view", "draw"]\n'
                          f'[[token]]\nname = "reads"\nsha256 = "{digest}"\nscopes = ["view"]\n', encoding="utf-8")
        grants.chmod(0o600)
        self.install("first")

    def install(self, name: str) -> None:
        for part in ("key", "pem"):
            path = self.folder / f"server.{part}.new"
            path.write_bytes((self.folder / f"{name}.{part}").read_bytes())
            path.chmod(0o600)
            path.rename(self.folder / f"server.{part}")

    def listens(self) -> list[str]:
        self.tcp = free_port()
        return [f"tls:127.0.0.1:{self.tcp}"]

    def security(self) -> str:
        return (f'[security]\ntls_certificate = "{self.folder}/server.pem"\ntls_key = "{self.folder}/server.key"\n'
                f'tls_client_ca = "{self.folder}/first.pem"\ngrants = "{self.folder}/grants.toml"\nunix_scopes = "all"\n')

    def dial(self, ca: str) -> voxel.Connection:
        who = voxel.Credentials(ca=f"{self.folder}/{ca}.pem", certificate=f"{self.folder}/first.pem", key=f"{self.folder}/first.key",
                                server_name="display.example")
        return voxel.connect(f"tls:127.0.0.1:{self.tcp}", timeout=PATIENCE, credentials=who)

    def by_certificate(self) -> None:
        with self.dial("first") as v:
            v.sphere("ball", radius=0.2, color="green")
            assert v.commit().wait_shown(timeout=PATIENCE)

    def channel(self, ca: str) -> grpc.Channel:
        pem = [(self.folder / name).read_bytes() for name in (f"{ca}.pem", "first.key", "first.pem")]
        return grpc.secure_channel(f"127.0.0.1:{self.tcp}", grpc.ssl_channel_credentials(*pem), [("grpc.ssl_target_name_override", "display.example")])

    def turned_away(self) -> None:
        with contextlib.closing(self.channel("first")) as channel:
            try:
                ask(channel, "DisplayService/ListDisplays", display_pb2.ListDisplaysRequest(), display_pb2.ListDisplaysResponse, "not-" + TOKEN)
                raise RuntimeError("a token that nobody gave was let in")
            except grpc.RpcError as error:
                assert error.code() == grpc.StatusCode.UNAUTHENTICATED, error

    def exchanged(self) -> None:
        taken = self.metric("voxeld_tls_files_taken_total")
        self.install("second")
        self.until("voxeld_tls_files_taken_total", taken + 1)
        with self.dial("second") as v:
            v.displays(timeout=PATIENCE)

    def by_token(self) -> None:
        with contextlib.closing(self.channel("second")) as channel:
            listed = ask(channel, "DisplayService/ListDisplays", display_pb2.ListDisplaysRequest(), display_pb2.ListDisplaysResponse, TOKEN)
            assert len(listed.displays) == 2
            try:
                ask(channel, "DisplayService/UpdateDisplay", display_pb2.UpdateDisplayRequest(name="stack", blank=True), display_pb2.DisplayDescription, TOKEN)
                raise RuntimeError("who may look blanked a display")
            except grpc.RpcError as error:
                assert error.code() == grpc.StatusCode.PERMISSION_DENIED, error


class Watched(Draws):
    about = "who watches: a page both displays over a WebSocket, others the scene, a volume and the statistics"
    steps = ("page", "scene", "volume", "stats", "capture")

    def page(self) -> None:
        page = subprocess.Popen([sys.executable, str(Path(__file__).parent / "viewer.py"), str(self.port), "stack", "rotor"], stdout=subprocess.PIPE,
                                stderr=subprocess.DEVNULL, text=True)
        try:
            assert page.stdout is not None
            with self.connect(name="moves") as v:
                for turn in range(100):
                    v.sphere("ball", radius=0.1 + turn % 10 / 20, color="green")
                    v.commit().wait_shown(timeout=PATIENCE)
                    if select.select([page.stdout], [], [], 0)[0]:
                        break
            # A page that ends without output is an answer too.
            assert select.select([page.stdout], [], [], PATIENCE)[0] and page.stdout.readline() == "reads\n", "the page was sent nothing"
        finally:
            page.kill()
            page.communicate()

    def scene(self) -> None:
        with self.connect(name="watches") as v:
            watch = v.watch_scene(contents=True, timeout=PATIENCE)
            v.box("box", size=(0.2, 0.2, 0.2), color="blue")
            v.commit().wait(PATIENCE)
            while not any(entity.info.key.id == "box" for entity in next(watch).entities):
                pass
            watch.close()

    def volume(self) -> None:
        with contextlib.closing(grpc.insecure_channel(self.server)) as channel:
            watch = channel.unary_stream("/voxeld.v1.DisplayService/WatchVolume", display_pb2.WatchVolumeRequest.SerializeToString, display_pb2.VolumeChunk.FromString)
            chunks = watch(display_pb2.WatchVolumeRequest(name="rotor"), timeout=PATIENCE)
            assert next(iter(chunks)).header.volume > 0
            chunks.cancel()

    def stats(self) -> None:
        with self.connect(name="asks") as v:
            for _ in range(3):
                v.stats(timeout=PATIENCE)


class Operated(Draws):
    about = "an operator: brightness, blank, a pattern; owners listed, hidden, limited and evicted; a layer cleared; an entity explained"
    steps = ("display", "owners", "cleared", "capture")

    def display(self) -> None:
        with contextlib.closing(grpc.insecure_channel(self.server)) as channel:
            for name in ("stack", "rotor"):
                for request in (display_pb2.UpdateDisplayRequest(brightness=0.5), display_pb2.UpdateDisplayRequest(blank=True),
                                display_pb2.UpdateDisplayRequest(blank=False), display_pb2.UpdateDisplayRequest(test_pattern=display_pb2.TEST_PATTERN_AXES),
                                display_pb2.UpdateDisplayRequest(test_pattern=display_pb2.TEST_PATTERN_NONE), display_pb2.UpdateDisplayRequest(brightness=1)):
                    request.name = name
                    ask(channel, "DisplayService/UpdateDisplay", request, display_pb2.DisplayDescription)

    def owners(self) -> None:
        with contextlib.closing(grpc.insecure_channel(self.server)) as channel, self.connect(name="owned") as v:
            def listed() -> Any:
                return ask(channel, "SceneService/ListOwners", scene_pb2.ListOwnersRequest(), scene_pb2.ListOwnersResponse).owners

            v.layer("own").box("box", size=(0.3, 0.3, 0.3), color="green")
            v.commit().wait_shown(timeout=PATIENCE)
            mine = next(owner.owner for owner in listed() if "owned" in owner.client_names)
            key = scene_pb2.EntityKey(owner=mine, layer="own", id="box")
            assert ask(channel, "SceneService/ExplainEntity", scene_pb2.ExplainEntityRequest(key=key, display="stack"), scene_pb2.ExplainEntityResponse).visibility
            for request in (scene_pb2.ControlOwnerRequest(hidden=True), scene_pb2.ControlOwnerRequest(hidden=False),
                            scene_pb2.ControlOwnerRequest(max_entities=5), scene_pb2.ControlOwnerRequest(evict=True)):
                request.owner = mine
                ask(channel, "SceneService/ControlOwner", request, scene_pb2.OwnerInfo)
            if any(owner.owner == mine and owner.entities for owner in listed()):
                raise RuntimeError("an owner who was evicted has entities")

    def cleared(self) -> None:
        with contextlib.closing(grpc.insecure_channel(self.server)) as channel, self.connect(name="drawn") as v:
            v.layer("own").box("box", size=(0.3, 0.3, 0.3), color="green")
            v.commit().wait(PATIENCE)
            gone = ask(channel, "SceneService/ClearLayer", scene_pb2.ClearLayerRequest(layer="own"), scene_pb2.ClearLayerResponse)
            assert gone.entities == 1


class WorkerLost(Draws):
    about = "the engine in a process of its own, which is killed, and comes back"
    steps = ("draw", "killed", "capture")
    engine = "in_worker = true\nworker_deadline_ns = 1000000000\n"

    def killed(self) -> None:
        for pid in Path(f"/proc/{self.pid}/task/{self.pid}/children").read_text(encoding="ascii").split():
            with contextlib.suppress(OSError):
                if "voxeld-engine" in Path(f"/proc/{pid}/cmdline").read_text(encoding="ascii"):
                    os.kill(int(pid), signal.SIGKILL)
        with self.connect(name="goes on") as v:
            for turn in range(5):
                v.sphere("ball", radius=0.1 + turn / 20, color="green")
                assert v.commit().wait_shown(timeout=PATIENCE)
        self.until("voxeld_display_engine_returns_total", 1)


class Devices(Draws):
    about = "a device that stalls and is unplugged, two that show together, lights in a network"
    steps = ("show", "unplugged", "capture")
    lights: Optional[socket.socket] = None

    def displays(self) -> str:
        self.lights = socket.socket(type=socket.SOCK_DGRAM)
        self.lights.bind(("127.0.0.1", 0))
        self.lights.settimeout(PATIENCE)
        simulated = 'driver = "simulated"\nsize = "12x12x8"\nrate = 120\n'
        return (f'[[display]]\nname = "stack"\n{simulated}faults = "stall@t20;unplug:30@t60"\n'
                f'[[display]]\nname = "left"\n{simulated}genlock = "wall"\n[[display]]\nname = "right"\n{simulated}genlock = "wall"\n'
                f'[[display]]\nname = "lights"\ndriver = "network"\naddress = "127.0.0.1:{self.lights.getsockname()[1]}"\nprotocol = "ddp"\ncube = "4x4x4"\n')

    def show(self) -> None:
        assert self.lights is not None
        with self.connect(name="one") as v:
            v.box("box", size=(2, 2, 2), color="white", fill="solid")
            assert len(v.commit().wait_shown(timeout=PATIENCE)) == 4
            while not any(self.lights.recv(2000)[10:]):
                pass

    def unplugged(self) -> None:
        with self.connect(name="two") as v:
            for turn in range(200):
                v.sphere("ball", radius=0.2 + turn % 9 / 10, color="green")
                v.commit().wait_shown(timeout=PATIENCE)
                if turn % 5 == 4 and self.metric('voxeld_display_attaches_total{display="stack"}') >= 2:
                    return
            raise AssertionError("the device was never unplugged")


SCENARIOS: dict[str, type[Life]] = {
    "ordinary": Ordinary, "streams": Streams, "resumed": Resumed, "kept": Kept, "assets": Assets, "secured": Secured, "watched": Watched,
    "operated": Operated, "worker_lost": WorkerLost, "devices": Devices}
