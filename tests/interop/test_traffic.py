"""Traffic of a bus over the bench API while commands of the program are the master."""

import urllib.request

import pytest
from line import TWO_DRIVES, Line, servodrome

ONE_SLAVE = """
[[bus]]
name = "ecat"
type = "ethercat"

[[axis]]
name = "j"
product = "jmc_ec"
bus = "ecat"
"""


def capture_of(line, bus, format):
    with urllib.request.urlopen(f"{line.bench.url}/buses/{bus}/capture?format={format}") as answer:
        return answer.read()


@pytest.mark.once
def test_ethercat_in_words_and_as_a_capture(tmp_path):
    line = Line(tmp_path, ONE_SLAVE, ["ecat=udp:127.0.0.1:0"])
    try:
        assert line.bench.put("buses/ecat/traffic", {"record": True})["recording"]
        link = line.links["ecat"][0]
        assert "6041:00 Statusword" in servodrome("get", "--bus", link, "--node", 1, "6041")
        request, answer = line.bench.get("buses/ecat/traffic?kind=sdo")["rows"]
        assert request["text"] == "SDO read 6041:00 Statusword"
        assert answer["text"].startswith("SDO 6041:00 Statusword is ")
        assert (answer["from"], answer["node"], answer["error"]) == ("slaves", 1, False)
        assert answer["values"][0]["object"] == "6041:00"
        file = tmp_path / "capture.pcap"
        file.write_bytes(capture_of(line, "ecat", "pcap"))
        assert request["text"] in servodrome("sniff", file)
    finally:
        line.stop()


@pytest.mark.once
@pytest.mark.parametrize("format", ["pcap", "candump"])
def test_a_can_capture_is_read_by_sniff(tmp_path, format):
    line = Line(tmp_path, TWO_DRIVES, ["can0=socketcand:127.0.0.1:0/can0"])
    try:
        line.bench.put("buses/can0/traffic", {"record": True})
        servodrome("get", "--bus", line.links["can0"][0], "--node", 2, "--product", "generic402", "6041")
        rows = line.bench.get("buses/can0/traffic?kind=sdo&node=2")["rows"]
        assert [row["from"] for row in rows] == ["master", "reference"]
        file = tmp_path / "capture"
        file.write_bytes(capture_of(line, "can0", format))
        shown = servodrome("sniff", file, "--filter", "kind=sdo")
        assert all(row["text"] in shown for row in rows), shown
    finally:
        line.stop()
