"""The server's address: HOST:PORT, tls:HOST:PORT or unix:PATH, found as voxelctl finds it."""
from __future__ import annotations

import ipaddress
import os
import stat
from typing import Mapping

from .errors import InvalidValue

DEFAULT_TCP = "127.0.0.1:50551"
SERVICE_SOCKET = "/run/voxeld/voxeld.sock"


def _trusted(path: str) -> bool:
    # A socket that another user put into a shared directory must not be trusted. Only root can create the service's own
    # directory, whichever user the service runs as.
    try:
        info = os.lstat(path)
    except OSError:
        return False
    mine = info.st_uid in (os.geteuid(), 0) or path == SERVICE_SOCKET
    return stat.S_ISSOCK(info.st_mode) and mine and os.access(path, os.R_OK | os.W_OK)


def choose(address: str | None = None, environment: Mapping[str, str] | None = None) -> str:
    """Returns `address`, else VOXELD_SERVER, else the first existing unix socket: in the run-time directory, the service's, in
    the user's own directory in /tmp; else 127.0.0.1:50551."""
    if address:
        return address
    env = os.environ if environment is None else environment
    if env.get("VOXELD_SERVER"):
        return env["VOXELD_SERVER"]
    folder = env.get("XDG_RUNTIME_DIR", "")
    candidates = [f"{folder}/voxeld.sock"] if folder.startswith("/") else []
    candidates += [SERVICE_SOCKET, f"/tmp/voxeld-{os.geteuid()}/voxeld.sock"]
    for path in candidates:
        if _trusted(path):
            return f"unix:{path}"
    return DEFAULT_TCP


def is_tls(address: str) -> bool:
    return address.startswith("tls:")


def is_local(address: str) -> bool:
    """Returns whether data sent to the address stays on this machine."""
    if address.startswith("unix:"):
        return True
    host = address.removeprefix("tls:").rpartition(":")[0].strip("[]")
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def target(address: str) -> str:
    """Returns the address in gRPC's notation, which does not mention TLS."""

    def wrong(why: str) -> InvalidValue:
        return InvalidValue(
            f"the address {address!r} {why}; give HOST:PORT, tls:HOST:PORT or unix:PATH, such as {DEFAULT_TCP} or "
            f"unix:{SERVICE_SOCKET}")

    if address.startswith("unix:"):
        path = address[len("unix:"):]
        if path.startswith("//"):
            path = path[2:]
        if not path.startswith("/"):
            raise wrong("has no absolute path")
        return f"unix:{path}"
    plain = address.removeprefix("tls:")
    host, colon, port = plain.rpartition(":")
    if not colon:
        raise wrong("has no port")
    if not host:
        raise wrong("has no host")
    if ":" in host and not (host.startswith("[") and host.endswith("]")):
        raise wrong("has more than one colon (write an IPv6 number as [::1]:50551)")
    if not (port.isascii() and port.isdigit() and 1 <= int(port) <= 65535):
        raise wrong(f"has the port {port!r}, which is not 1 to 65535")
    return f"dns:///{plain}"
