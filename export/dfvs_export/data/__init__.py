"""Training pairs with exact flow, made from random rooms of textured quadrilaterals."""
