#!/bin/bash
# DDS Security for huetrack: certificates, permissions, and encryption of all data.
#
#   configs/dds/secure.sh FOLDER                     creates an authority, and the members service, watcher, operator
#   configs/dds/secure.sh FOLDER NAME:ROLE ...       members of the same authority, each with a name and a role:
#       service    huetrackd run, replay: everything
#       host       huetrackd capture: sends its cameras' frames and its clock, no positions
#       watcher    huetrack watch, log, status, view: receives everything, sends nothing
#       operator   huetrack view: receives everything, may request what control: {allow_...: true} allows
#
# A member is FOLDER/NAME with a profile, FOLDER/NAME/huetrack.xml: copy it to its machine, to the same path, and use
# it by dds: {profile: FOLDER/NAME/huetrack.xml} in huetrackd, --profiles in huetrack. Keep FOLDER/authority: its key creates
# members. Participants without a certificate of this authority can neither read nor write. Certificates are valid for ten years.
# Needs openssl.
set -euo pipefail
[ $# -gt 0 ] && [ "${1#-}" = "$1" ] || { sed -n 2,14p "$0"; exit 2; }
command -v openssl >/dev/null || { echo "openssl is missing: apt-get install openssl" >&2; exit 1; }

days=3650
umask 077
mkdir -p "$1"
folder="$(cd "$1" && pwd)"
shift
authority=$folder/authority
[ $# -gt 0 ] || set -- service:service watcher:watcher operator:operator

# Validate all arguments first.
names=' '
for member in "$@"; do
  name="${member%%:*}" role="${member#*:}"
  case $member in *:*) ;; *) echo "$member: give NAME:ROLE, for example $member:watcher" >&2; exit 2 ;; esac
  case $role in service|host|watcher|operator) ;; *)
    echo "$member: $role is no role: service, host, watcher or operator" >&2; exit 2 ;; esac
  [[ $name =~ ^[A-Za-z0-9._-]+$ ]] && [ "$name" != authority ] ||
    { echo "$member: a name has letters, digits, '.', '_' and '-', and is not authority" >&2; exit 2; }
  [[ $names != *" $name "* ]] || { echo "$name is given twice" >&2; exit 2; }
  names+="$name "
  [ ! -e "$folder/$name" ] || { echo "$folder/$name is there already: take another name, or remove it" >&2; exit 1; }
done

sign() {  # FILE: FILE.p7s beside it
  openssl smime -sign -in "$1" -text -out "$1.p7s" -signer "$authority/authority.pem" -inkey "$authority/authority.key"
}

if [ ! -e "$authority/authority.pem" ]; then
  mkdir -p "$authority"
  openssl ecparam -name prime256v1 -genkey -noout -out "$authority/authority.key"
  openssl req -x509 -new -key "$authority/authority.key" -sha256 -days $days -subj "/O=huetrack/CN=authority" \
    -out "$authority/authority.pem"
  cat >"$authority/governance.xml" <<'XML'
<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="omg_shared_ca_governance.xsd">
  <domain_access_rules>
    <domain_rule>
      <domains><id_range><min>0</min><max>232</max></id_range></domains>
      <allow_unauthenticated_participants>false</allow_unauthenticated_participants>
      <enable_join_access_control>true</enable_join_access_control>
      <discovery_protection_kind>ENCRYPT</discovery_protection_kind>
      <liveliness_protection_kind>ENCRYPT</liveliness_protection_kind>
      <rtps_protection_kind>NONE</rtps_protection_kind>
      <topic_access_rules>
        <topic_rule>
          <topic_expression>*</topic_expression>
          <enable_discovery_protection>true</enable_discovery_protection>
          <enable_liveliness_protection>true</enable_liveliness_protection>
          <enable_read_access_control>true</enable_read_access_control>
          <enable_write_access_control>true</enable_write_access_control>
          <metadata_protection_kind>ENCRYPT</metadata_protection_kind>
          <data_protection_kind>NONE</data_protection_kind>
        </topic_rule>
      </topic_access_rules>
    </domain_rule>
  </domain_access_rules>
</dds>
XML
  sign "$authority/governance.xml"
  echo "authority: $authority"
fi

topics() {  # KIND TOPIC...: what may be published or subscribed
  [ $# -gt 1 ] || return 0
  echo "        <$1><topics>"
  printf '          <topic>%s</topic>\n' "${@:2}"
  echo "        </topics></$1>"
}

for member in "$@"; do
  name="${member%%:*}" role="${member#*:}"
  all='*' publish=() subscribe=("$all")
  case $role in
    service) publish=("$all") ;;
    host) publish=('huetrack/frames/*' 'huetrack/matches/*' huetrack/camera_host huetrack/clock_echo)
      subscribe=(huetrack/clock_probe huetrack/looked_for 'huetrack/outlines/*') ;;
    operator) publish=('huetrack/*_request') ;;
  esac
  of=$folder/$name
  mkdir "$of"
  openssl ecparam -name prime256v1 -genkey -noout -out "$of/member.key"
  openssl req -new -key "$of/member.key" -subj "/O=huetrack/CN=$name" -out "$of/request.pem"
  # For authentication and nothing else: Fast DDS 2.9 takes permissions that any certificate of the authority has signed,
  # if that one may sign.
  openssl x509 -req -in "$of/request.pem" -CA "$authority/authority.pem" -CAkey "$authority/authority.key" \
    -set_serial "0x$(openssl rand -hex 8)" -sha256 -days $days -out "$of/member.pem" \
    -extfile <(printf 'basicConstraints = critical, CA:FALSE\nextendedKeyUsage = clientAuth, serverAuth\n') 2>/dev/null
  rm "$of/request.pem"
  cp "$authority/authority.pem" "$authority/governance.xml.p7s" "$of"
  {
    cat <<XML
<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="omg_shared_ca_permissions.xsd">
  <permissions>
    <grant name="$name">
      <subject_name>CN=$name,O=huetrack</subject_name>
      <validity>
        <not_before>$(date -u -d yesterday +%Y-%m-%dT%H:%M:%S)</not_before>
        <not_after>$(date -u -d "+$days days" +%Y-%m-%dT%H:%M:%S)</not_after>
      </validity>
      <allow_rule>
        <domains><id_range><min>0</min><max>232</max></id_range></domains>
$(topics publish "${publish[@]}")
$(topics subscribe "${subscribe[@]}")
      </allow_rule>
      <default>DENY</default>
    </grant>
  </permissions>
</dds>
XML
  } >"$of/permissions.xml"
  sign "$of/permissions.xml"
  rm "$of/permissions.xml"
  property() { echo "            <property><name>dds.sec.$1</name><value>$2</value></property>"; }
  {
    cat <<XML
<?xml version="1.0" encoding="UTF-8"?>
<!-- $name, a $role: made by configs/dds/secure.sh. The paths are absolute; whoever moves the folder changes them. -->
<dds xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <profiles>
    <transport_descriptors>
      <transport_descriptor>
        <transport_id>udp</transport_id>
        <type>UDPv4</type>
        <!-- A camera's frames are lost with large datagrams, of which each lost packet takes one; but two members who get to
             know one another send their certificates and permissions in one, which has to fit. -->
        <sendBufferSize>1048576</sendBufferSize>
        <receiveBufferSize>4194304</receiveBufferSize>
        <maxMessageSize>8192</maxMessageSize>
      </transport_descriptor>
    </transport_descriptors>
    <participant profile_name="huetrack" is_default_profile="true">
      <rtps>
        <builtin>
          <discovery_config>
            <leaseDuration><sec>3</sec></leaseDuration>
            <leaseAnnouncement><sec>1</sec></leaseAnnouncement>
          </discovery_config>
        </builtin>
        <useBuiltinTransports>false</useBuiltinTransports>
        <userTransports>
          <transport_id>udp</transport_id>
        </userTransports>
        <propertiesPolicy>
          <properties>
XML
    property auth.plugin builtin.PKI-DH
    property auth.builtin.PKI-DH.identity_ca "file://$of/authority.pem"
    property auth.builtin.PKI-DH.identity_certificate "file://$of/member.pem"
    property auth.builtin.PKI-DH.private_key "file://$of/member.key"
    property access.plugin builtin.Access-Permissions
    property access.builtin.Access-Permissions.permissions_ca "file://$of/authority.pem"
    property access.builtin.Access-Permissions.governance "file://$of/governance.xml.p7s"
    property access.builtin.Access-Permissions.permissions "file://$of/permissions.xml.p7s"
    property crypto.plugin builtin.AES-GCM-GMAC
    cat <<'XML'
          </properties>
        </propertiesPolicy>
      </rtps>
    </participant>
  </profiles>
</dds>
XML
  } >"$of/huetrack.xml"
  echo "$role: $of/huetrack.xml"
done
