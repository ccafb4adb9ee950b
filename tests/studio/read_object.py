#!/usr/bin/env python3
"""Reads an object of a CANopen drive with the library canopen, and prints its number, or the abort code.

read_object.py HOST:PORT/CHANNEL NODE INDEX
"""

import re
import sys

import canopen
from canopen.sdo.exceptions import SdoAbortedError

host, port, channel = re.match(r"([\d.]+):(\d+)/(\w+)", sys.argv[1]).groups()
network = canopen.Network()
network.connect(interface="socketcand", host=host, port=int(port), channel=channel)
sdo = network.add_node(int(sys.argv[2]), canopen.ObjectDictionary()).sdo
sdo.RESPONSE_TIMEOUT = 10
try:
    print(int.from_bytes(sdo.upload(int(sys.argv[3], 16), 0), "little"))
except SdoAbortedError as error:
    print(f"abort {error.code:08X}")
network.disconnect()
