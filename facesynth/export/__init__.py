"""From trained models to folders that run without torch: ONNX graphs, arrays and a manifest, each graph checked."""
