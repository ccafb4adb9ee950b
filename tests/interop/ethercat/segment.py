"""Line files with an EtherCAT segment."""

from line import TRAVEL


def segment(count, product="generic402-ec", travel=TRAVEL, first=1, **keys):
    """`count` drives in line, drive1 and up. A key's value may be a function of the drive's number."""
    text = '[[bus]]\nname = "ecat"\ntype = "ethercat"\n' if first == 1 else ""
    for number in range(first, first + count):
        text += f'\n[[axis]]\nname = "drive{number}"\nproduct = "{product}"\nbus = "ecat"\n'
        for key, value in keys.items():
            value = value(number) if callable(value) else value
            text += f"{key} = {value!r}\n".replace("'", '"')
        text += travel
    return text
