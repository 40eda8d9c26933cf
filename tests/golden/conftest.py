from collective_lines import lines, same_lines

__all__ = ["lines", "same_lines"]
