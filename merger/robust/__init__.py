"""Beyond the paper: ``--method robust``, which places a map right or leaves it out; read ``pipeline`` first."""
