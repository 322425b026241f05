"""Descriptors of a simulated board."""

from __future__ import annotations

from types import SimpleNamespace

SERIAL_STRING_INDEX = 3


def device_descriptor(
    vendor_id: int, product_id: int, *, address: int, states_serial_number: bool
) -> SimpleNamespace:
    """Return the device descriptor, with the fields pyusb asks for.

    ``address`` is a new one after each enumeration.
    """
    return SimpleNamespace(
        bLength=18,
        bDescriptorType=1,
        bcdUSB=0x0200,
        bDeviceClass=0xFF,
        bDeviceSubClass=0,
        bDeviceProtocol=0,
        bMaxPacketSize0=64,
        idVendor=vendor_id,
        idProduct=product_id,
        bcdDevice=0x0100,
        iManufacturer=0,
        iProduct=0,
        iSerialNumber=SERIAL_STRING_INDEX if states_serial_number else 0,
        bNumConfigurations=1,
        address=address,
        bus=1,
        port_number=1,
        port_numbers=(1,),
        speed=3,
    )


def configuration_descriptor() -> SimpleNamespace:
    """Return the only configuration's descriptor."""
    return SimpleNamespace(
        bLength=9,
        bDescriptorType=2,
        wTotalLength=46,
        bNumInterfaces=1,
        bConfigurationValue=1,
        iConfiguration=0,
        bmAttributes=0x80,
        bMaxPower=50,
        extra_descriptors=[],
    )


def interface_descriptor(endpoints: int) -> SimpleNamespace:
    """Return the descriptor of the only interface and its number of endpoints."""
    return SimpleNamespace(
        bLength=9,
        bDescriptorType=4,
        bInterfaceNumber=0,
        bAlternateSetting=0,
        bNumEndpoints=endpoints,
        bInterfaceClass=0xFF,
        bInterfaceSubClass=0,
        bInterfaceProtocol=0,
        iInterface=0,
        extra_descriptors=[],
    )


def endpoint_descriptor(address: int) -> SimpleNamespace:
    """Return a bulk endpoint's descriptor, with the fields pyusb asks for."""
    return SimpleNamespace(
        bLength=7,
        bDescriptorType=5,
        bEndpointAddress=address,
        bmAttributes=2,
        wMaxPacketSize=512,
        bInterval=0,
        bRefresh=0,
        bSynchAddress=0,
        extra_descriptors=[],
    )
