"""A second maker of pictures, independent of the first: bent sheets, photographed ray by ray."""
