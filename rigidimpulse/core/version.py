"""The version of the library, for whatever writes it down."""

VERSION = "0.1.0"
