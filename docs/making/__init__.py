"""What the site is made of besides its pages: extensions of Sphinx, and what draws its pictures."""
