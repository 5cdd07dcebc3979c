"""Ionic models: what flows through the membrane of a cell. One file a model; `registry` names them."""
