"""Messages of a recording: channels, conversion, Foxglove's schemas."""
