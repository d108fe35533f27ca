/* From here on a begin and a step are those of whole paths. */
#undef begin
#undef step
#undef sampled_depth
#undef deposit
#undef escape_through_depth
#undef tracker
