#!/usr/bin/env python3
"""A page, as a program that can be stopped: it watches displays over the WebSocket of the http port, and acknowledges each volume as shown,
upon which
the next is sent. It prints a line once volumes arrive ("reads"), and another once some arrive after it was stopped and continued ("reads
again").
For fault_matrix_test and manual use; it runs until it is killed."""
import argparse
import signal
import socket
import sys
import threading
from types import FrameType
from typing import Optional

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("port", type=int, help="the daemon's http port on this machine")
parser.add_argument("display", nargs="+", help="what it watches")
options = parser.parse_args()
goes_on = threading.Event()


def continued(_number: int, _frame: Optional[FrameType]) -> None:
    goes_on.set()


def text(message: str) -> bytes:
    """Returns a text frame, masked with zeros."""
    return bytes([0x81, 0x80 | len(message), 0, 0, 0, 0]) + message.encode()


signal.signal(signal.SIGCONT, continued)
with socket.create_connection(("127.0.0.1", options.port)) as page:
    page.sendall(f"GET /volumes HTTP/1.1\r\nHost: 127.0.0.1:{options.port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                 "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n".encode())
    if b" 101 " not in page.recv(4096):
        sys.exit("the server takes no WebSocket")
    for number, display in enumerate(options.display, 1):
        page.sendall(text(f'{{"watch":"{display}","id":{number}}}'))
    says = ["reads", "reads again"]
    taken = 0
    while piece := page.recv(1 << 16):
        taken += len(piece)
        for number in range(1, len(options.display) + 1):
            page.sendall(text(f'{{"shown":{number}}}'))
        if says[0] == "reads" and taken > 1000 or says[0] == "reads again" and goes_on.is_set():
            print(says[0], flush=True)
            says = [*says[1:], ""]
            goes_on.clear()
