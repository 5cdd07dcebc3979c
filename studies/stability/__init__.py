"""Maps of where a coupled run is sound: its class in every cell, and the boundary that theory predicts."""
