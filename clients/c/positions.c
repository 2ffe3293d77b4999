/* Positions in C with Cyclone DDS (Debian: cyclonedds-dev, cyclonedds-tools), which is not part of huetrack:
     idlc IDL/huetrack.idl                                 # idl/huetrack.idl of the source tree
     cc -o positions positions.c huetrack.c -lddsc
     ./positions                                           # ROS_DOMAIN_ID is the domain, as for the service; else 0 */
#include <dds/dds.h>
#include <stdio.h>
#include <stdlib.h>

#include "huetrack.h" /* made by idlc */

int main(void) {
  const char* domain = getenv("ROS_DOMAIN_ID");
  dds_entity_t participant = dds_create_participant(domain && *domain ? (dds_domainid_t)atoi(domain) : 0, NULL, NULL);
  if (participant < 0) {
    fprintf(stderr, "cannot join the domain: %s\n", dds_strretcode(-participant));
    return 1;
  }
  dds_entity_t topic =
      dds_create_topic(participant, &huetrack_msg_ObjectPosition_desc, "huetrack/object_position", NULL, NULL);
  dds_entity_t reader = dds_create_reader(participant, topic, NULL, NULL);
  for (;;) {
    void* sample[1] = {NULL};
    dds_sample_info_t info;
    while (dds_take(reader, sample, &info, 1, 1) == 1) {
      const huetrack_msg_ObjectPosition* p = sample[0];
      /* The state tells whether the position is valid; a sample without valid_data: the target ended. */
      if (info.valid_data &&
          (p->state == huetrack_msg_TRACK_STATE_TRACKING || p->state == huetrack_msg_TRACK_STATE_COASTING)) {
        printf("%s %.4f %.4f %.4f m\n", p->target, p->position[0], p->position[1], p->position[2]);
        fflush(stdout); /* also for pipes */
      }
      dds_return_loan(reader, sample, 1);
    }
    dds_sleepfor(DDS_MSECS(5));
  }
}
