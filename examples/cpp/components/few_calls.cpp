// The mission in a few calls. They are the same for every autopilot.
#include "I_RosDron.h"

int main() {
    uc_drone_gps_fly(20);
    uc_drone_gps_go(43.47215, -3.79910, 32);
    uc_drone_gps_go(43.47230, -3.79985, 32);
    uc_drone_gps_go(43.47170, -3.79970, 32);
    uc_drone_land_ground();
}
