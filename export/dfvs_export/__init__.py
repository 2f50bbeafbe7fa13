"""Networks, training data, training and export: the only room that knows torch."""

import dfvs_models  # noqa: F401  ONNX Runtime is not to report what is exported: see there
