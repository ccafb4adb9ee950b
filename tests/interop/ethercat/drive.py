"""A CiA 402 drive on EtherCAT, as a master uses it: mapped objects in process data, all objects over SDO."""

import drive402

KINDS = {
    "BOOLEAN": (1, False),
    "INTEGER8": (8, True),
    "INTEGER16": (16, True),
    "INTEGER32": (32, True),
    "INTEGER64": (64, True),
    "UNSIGNED8": (8, False),
    "UNSIGNED16": (16, False),
    "UNSIGNED32": (32, False),
    "UNSIGNED64": (64, False),
}


class Drive(drive402.Drive402):
    """The procedures of Drive402; mapped objects are accessed through the process data."""

    def __init__(self, master, number, bench, name, objects):
        super().__init__(None, bench, name)
        self.master = master
        self.number = number
        self.slave = master.slaves[number]
        self.objects = objects
        self.outputs = {}  # (index, sub): bit offset
        self.inputs = {}
        self.values = {}  # values that are sent in every cycle
        self.emergencies = []
        self.slave.add_emergency_callback(self.emergencies.append)

    def kind(self, index, sub):
        return KINDS[self.objects[index, sub]["type"]]

    # --- SDO
    def upload(self, index, sub=0):
        data = self.slave.sdo_read(index, sub)
        if (name := self.objects[index, sub]["type"]) not in KINDS:
            return data.decode() if name == "VISIBLE_STRING" else data
        return int.from_bytes(data, "little", signed=self.kind(index, sub)[1])

    def download(self, index, value, sub=0):
        bits, signed = self.kind(index, sub)
        self.slave.sdo_write(index, sub, value.to_bytes(max(1, bits // 8), "little", signed=signed))

    def remap(self, assignment, mapping, number=0x1600):
        """Writes a mapping (a list of (index, sub, bits)) and assigns only this PDO, in the order of the standard."""
        self.download(assignment, 0)
        self.download(number, 0)
        for position, (index, sub, bits) in enumerate(mapping, 1):
            self.download(number, index << 16 | sub << 8 | bits, position)
        self.download(number, len(mapping))
        self.download(assignment, number, 1)
        self.download(assignment, 1)

    # --- process data
    def learn_mapping(self):
        """Reads the present assignment; outputs start with the values of the objects."""
        self.outputs, self.inputs = self._layout(0x1C12), self._layout(0x1C13)
        self.values = {key: self.upload(*key) for key in self.outputs}
        self.master.each_cycle.append(lambda _: self.put())

    def _layout(self, assignment):
        layout, offset = {}, 0
        for pdo in range(1, self.upload(assignment) + 1):
            number = self.upload(assignment, pdo)
            for position in range(1, self.upload(number) + 1):
                entry = self.upload(number, position)
                index, sub, bits = entry >> 16, entry >> 8 & 0xFF, entry & 0xFF
                if index >= 0x1000:
                    layout.setdefault((index, sub), (offset, bits))
                offset += bits
        return layout

    def put(self):
        image = 0
        for key, (offset, bits) in self.outputs.items():
            image |= (self.values[key] & (1 << bits) - 1) << offset
        self.slave.output = image.to_bytes(len(self.slave.output), "little")

    def get(self, index, sub=0):
        offset, bits = self.inputs[index, sub]
        value = int.from_bytes(self.slave.input, "little") >> offset & (1 << bits) - 1
        signed = self.kind(index, sub)[1]
        return value - (1 << bits) if signed and value >> bits - 1 else value

    # --- the methods that Drive402 uses
    def read(self, index, sub=0):
        return self.get(index, sub) if (index, sub) in self.inputs else self.upload(index, sub)

    def write(self, index, value, sub=0):
        if (index, sub) in self.outputs:
            self.values[index, sub] = value
            self.master.pass_cycles(2)  # the second cycle is certain to contain the value
        else:
            self.download(index, value, sub)
