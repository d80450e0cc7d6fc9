"""From a closed surface to tetrahedra: pytetwild in a guarded process."""
