# Makes the headers' plain comments such as Doxygen reads. A heading that is drawn with a line of dashes is no documentation.
/^\/\* -+ .* -+ \*\/$/ d
# The first comment of a file is about the file.
1 s@^/\* ?@/** \\file\n * @
1 s@^// ?@/// \\file\n/// @
# What stands on lines of its own is about what follows; what stands behind code, about that code.
s@^( *)/\* @\1/** @
s@^( *[^ /*].*[;,{]) +/\* @\1 /**< @
