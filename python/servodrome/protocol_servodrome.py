"""The module that pyserial looks for at a URL "servodrome://BUS", in the packages of `serial.protocol_handler_packages`."""

from .serial_port import SerialPort as Serial

__all__ = ["Serial"]
