"""The mock camera: what the vehicle would see, rendered and published over Zenoh."""
