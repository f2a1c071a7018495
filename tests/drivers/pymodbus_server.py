"""A Modbus TCP server made with pymodbus: an independent peer for the driver.

Holds plain registers and plays a drive with the registers of config/profiles/leadshine_rs.toml: a move or homing that is
triggered is carried out within a few requests. Prints its port, then serves until its standard input closes.
"""

import asyncio
import os
import sys

from pymodbus.datastore import ModbusSequentialDataBlock, ModbusServerContext, ModbusSlaveContext

FEEDBACK, STATUS, TRIGGER, PATH, ALARM, ENABLE = 0x1014, 0x1003, 0x6002, 0x6200, 0x2203, 0x000F
ALARMED, ENABLED, RUNNING, DONE, HOMED = 1, 2, 4, 16, 64


class Drive(ModbusSequentialDataBlock):
    """Registers that move: `target` is approached by a quarter of the way with each look at the status."""

    def __init__(self):
        super().__init__(0, [0] * 0x10000)
        self.target = 0
        self.position = 0
        self.homed = False

    def getValues(self, address, count=1):
        if address <= STATUS < address + count:
            way = self.target - self.position
            self.position += way if abs(way) < 20 else way // 4 if way > 0 else -(-way // 4)
            running = self.position != self.target
            bits = (RUNNING if running else DONE) | (HOMED if self.homed and not running else 0)
            self.values[STATUS] = bits | (ENABLED if self.values[ENABLE] else 0)
            raw = self.position & 0xFFFFFFFF
            self.values[FEEDBACK : FEEDBACK + 2] = [raw >> 16, raw & 0xFFFF]
        return super().getValues(address, count)

    def setValues(self, address, values):
        super().setValues(address, values)
        last = address + len(values) - 1
        trigger = self.values[TRIGGER] if address <= TRIGGER <= last else 0
        if address <= PATH + 7 <= last and self.values[PATH + 7]:
            trigger = self.values[PATH + 7]
        if trigger == 0x10:
            raw = self.values[PATH + 1] << 16 | self.values[PATH + 2]
            self.target = raw - (1 << 32) if raw & 0x80000000 else raw
        elif trigger == 0x20:
            self.target, self.homed = 0, True
        elif trigger == 0x40:
            self.target = self.position


async def serve():
    from pymodbus.server.async_io import ModbusTcpServer

    # zero_mode: address 0 is address 0.
    context = ModbusServerContext(slaves={1: ModbusSlaveContext(hr=Drive(), zero_mode=True)}, single=False)
    server = ModbusTcpServer(context, address=("127.0.0.1", 0))
    task = asyncio.create_task(server.serve_forever())
    while getattr(server, "server", None) is None:
        await asyncio.sleep(0.01)
    print(server.server.sockets[0].getsockname()[1], flush=True)
    loop = asyncio.get_running_loop()
    await loop.run_in_executor(None, sys.stdin.read)
    task.cancel()
    os._exit(0)  # the executor's thread and pymodbus's connections need no farewell


asyncio.run(serve())
