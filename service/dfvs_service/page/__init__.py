"""HTML pages about flights, with all their styles, images and plots in them."""
