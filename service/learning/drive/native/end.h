/* Takes back the words of one.h and lanes.h. */
#undef TEXT
#undef NAME
#undef NUMBER
#undef MASK
#undef BITS
#undef OF
#undef PICK
#undef ANY
#undef NOT
#undef AS_BITS
#undef AS_NUMBER
#undef HELD
#undef STATE
#undef PLACE
#undef TARGET
#undef SUFFIX
#undef LANES
