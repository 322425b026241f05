"""Descriptors of the simulated board, in both enumeration states."""

from __future__ import annotations

from types import SimpleNamespace

VENDOR_ID = 0x0622
PRODUCT_UNLOADED = 0x0470
PRODUCT_LOADED = 0x2C01
ENDPOINTS = (0x01, 0x81, 0x82, 0x06)
SERIAL_STRING_INDEX = 3


def device_descriptor(product_id: int, *, address: int, loaded: bool) -> SimpleNamespace:
    """Return the device descriptor, with the fields pyusb asks for.

    ``address`` is a new one after each enumeration. ``loaded`` says whether the firmware runs; the
    bare chip states no serial number.
    """
    return SimpleNamespace(
        bLength=18,
        bDescriptorType=1,
        bcdUSB=0x0200,
        bDeviceClass=0xFF,
        bDeviceSubClass=0,
        bDeviceProtocol=0,
        bMaxPacketSize0=64,
        idVendor=VENDOR_ID,
        idProduct=product_id,
        bcdDevice=0x0100,
        iManufacturer=0,
        iProduct=0,
        iSerialNumber=SERIAL_STRING_INDEX if loaded else 0,
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


def interface_descriptor(*, loaded: bool) -> SimpleNamespace:
    """Return the only interface's descriptor, with the fields pyusb asks for.

    ``loaded`` says whether the firmware runs; the bare chip shows no endpoints here.
    """
    return SimpleNamespace(
        bLength=9,
        bDescriptorType=4,
        bInterfaceNumber=0,
        bAlternateSetting=0,
        bNumEndpoints=len(ENDPOINTS) if loaded else 0,
        bInterfaceClass=0xFF,
        bInterfaceSubClass=0,
        bInterfaceProtocol=0,
        iInterface=0,
        extra_descriptors=[],
    )


def endpoint_descriptor(index: int) -> SimpleNamespace:
    """Return a bulk endpoint's descriptor, with the fields pyusb asks for."""
    return SimpleNamespace(
        bLength=7,
        bDescriptorType=5,
        bEndpointAddress=ENDPOINTS[index],
        bmAttributes=2,
        wMaxPacketSize=512,
        bInterval=0,
        bRefresh=0,
        bSynchAddress=0,
        extra_descriptors=[],
    )
